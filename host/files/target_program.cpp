#include "files/target_program.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "files/input_error.hpp"
#include "files/point_list.hpp"
#include "files/quaternion.hpp"
#include "files/read_file.hpp"
#include "files/text.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '$'; }
bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

/// Brackets in brackets: no target of any of the languages needs more.
constexpr std::size_t deepest = 8;

/// One line for people, of which text may be long.
std::string shortened(std::string_view text) {
  constexpr std::size_t most = 40;
  return text.size() <= most ? std::string(text) : std::string(text.substr(0, most)) + "…";
}

class Source {
 public:
  explicit Source(TargetProgram& program) : program_(program), text_(program.text) {
    for (std::size_t at = text_.find('\n'); at < text_.size(); at = text_.find('\n', at + 1))
      line_ends_.push_back(at);
  }

  std::size_t line(std::size_t at) const {
    return 1 + static_cast<std::size_t>(std::lower_bound(line_ends_.begin(), line_ends_.end(), at) -
                                        line_ends_.begin());
  }
  std::string_view view(const TextSpan& s) const { return text_.substr(s.begin, s.end - s.begin); }
  InputError error(std::size_t at, const std::string& field, const std::string& expected,
                   const std::string& found) const {
    return {program_.path, line(at), field, expected, found};
  }
  double number(const TextSpan& s, const Unit& unit, const std::string& field) const {
    if (const auto value = parse_si(view(s), unit)) return *value;
    throw error(s.begin, field, "a finite number", fmt::format("'{}'", shortened(view(s))));
  }

 protected:
  void warn(std::size_t at, const std::string& text) {
    program_.warnings.push_back(fmt::format("{}:{}: {}", program_.path, line(at), text));
  }
  /// One tool and one frame are taken for all targets.
  void warn_of_several(const char* what, const std::map<std::string, std::size_t>& names, const char* taken) {
    if (names.size() < 2) return;
    std::string list;
    for (const auto& [name, at] : names)
      list += fmt::format("{}{} (line {})", list.empty() ? "" : ", ", shortened(name), line(at));
    program_.warnings.push_back(fmt::format("{}: several {}: {}. {}", program_.path, what, list, taken));
  }
  void warn_of_several_tools(const std::map<std::string, std::size_t>& names) {
    warn_of_several("tools", names, "All targets are corrected for the one tool of the robot file.");
  }
  /// Without blanks, in small letters: what two spellings of a name have in common.
  std::string plain(const TextSpan& s) const {
    std::string out = lower(view(s));
    out.erase(std::remove_if(out.begin(), out.end(), is_blank), out.end());
    return out;
  }
  TextSpan trimmed(TextSpan s) const {
    while (s.begin < s.end && is_blank(text_[s.begin])) ++s.begin;
    while (s.end > s.begin && is_blank(text_[s.end - 1])) --s.end;
    return s;
  }
  /// Behind the string that begins at `at`, or at the end of the line where it does not end before.
  std::size_t behind_string(std::size_t at) const {
    const std::size_t end = std::min(text_.find_first_of("\"\n", at + 1), text_.size());
    return end < text_.size() && text_[end] == '"' ? end + 1 : end;
  }
  std::size_t end_of_line(std::size_t at) const { return std::min(text_.find('\n', at), text_.size()); }
  std::size_t end_of_word(std::size_t at) const {
    while (at < text_.size() && is_word(text_[at])) ++at;
    return at;
  }

  TargetProgram& program_;
  std::string_view text_;

 private:
  std::vector<std::size_t> line_ends_;
};

// --- KRL -----------------------------------------------------------------------------------------------------------------

class Krl : public Source {
 public:
  using Source::Source;

  void read() {
    for (std::size_t at = 0; at < text_.size(); ++at) at = statement(at);
    refuse_parts_of_moves();
    warn_of_several_tools(tools_);
    warn_of_several("bases", bases_, "All poses are taken in the one frame of --frame.");
  }

 private:
  using Parts = std::map<std::string, TextSpan>;

  /// What stands in a line before an aggregate, outside of all braces.
  struct Statement {
    std::array<std::string, 3> last;  ///< words, small letters, the newest in front
    std::string name;                 ///< the last word outside of brackets, as written
    std::string assigned;             ///< the name before =
    std::string type;                 ///< of what is declared
    bool motion = false;              ///< PTP, LIN …
    bool structure = false;           ///< STRUC, whose words are no variables
    bool relative = false;            ///< PTP_REL …
    bool operation = false;           ///< behind the geometric operator
    int brackets = 0;

    bool moves() const { return motion && assigned.empty(); }
  };

  static bool is_position(const std::string& type) { return type == "e6pos" || type == "pos"; }
  static bool is_axes(const std::string& type) { return type == "e6axis" || type == "axis"; }

  /// One line; returns where it ends.
  std::size_t statement(std::size_t begin) {
    now_ = Statement();
    std::size_t at = begin;
    while (at < text_.size() && text_[at] != '\n') {
      const char c = text_[at];
      if (c == ';' || (c == '&' && at == begin)) {
        at = end_of_line(at);
      } else if (c == '"') {
        at = behind_string(at);
      } else if (c == '{') {
        at = aggregate(at, 0);
      } else if (is_word(c)) {
        const std::size_t end = end_of_word(at);
        word(at, end);
        at = end;
      } else {
        if (c == '[' || c == '(') ++now_.brackets;
        if (c == ']' || c == ')') --now_.brackets;
        if (c == '=') assignment(at);
        if (c == ':' && now_.brackets == 0) {
          parts_of_moves_.emplace(lower(now_.name), at);
          now_.operation = true;
        }
        ++at;
      }
    }
    return at;
  }

  void word(std::size_t begin, std::size_t end) {
    const std::string_view written = text_.substr(begin, end - begin);
    const std::string small = lower(written);
    std::rotate(now_.last.begin(), now_.last.end() - 1, now_.last.end());
    now_.last[0] = small;
    static constexpr std::array<std::string_view, 7> motions{"ptp",  "lin",   "circ", "sptp",
                                                             "slin", "scirc", "spl"};
    now_.motion = now_.motion || std::find(motions.begin(), motions.end(), small) != motions.end();
    now_.structure = now_.structure || small == "struc";
    // BAS(#TOOL,3)
    if (now_.last[2] == "bas" && (now_.last[1] == "tool" || now_.last[1] == "base"))
      (now_.last[1] == "tool" ? tools_ : bases_)
          .emplace(fmt::format("{}_data[{}]", now_.last[1], small), begin);
    if (now_.brackets != 0) return;
    now_.name = std::string(written);
    if (now_.relative || now_.operation) parts_of_moves_.emplace(small, begin);
    now_.operation = false;
    if (small.ends_with("_rel") && now_.assigned.empty()) now_.relative = true;
    if (!now_.type.empty() && !now_.structure) declared_[small] = now_.type;
    if (is_position(small) || is_axes(small) || small == "frame") now_.type = small;
  }

  void assignment(std::size_t at) {
    const auto beside = [this](std::size_t k) { return k < text_.size() ? text_[k] : ' '; };
    if (at > 0 && (beside(at - 1) == '=' || beside(at - 1) == '<' || beside(at - 1) == '>')) return;
    if (beside(at + 1) == '=') return;
    now_.relative = now_.operation = false;
    now_.assigned = now_.name;
    // $TOOL=… as well as $TOOL.X=…
    for (auto& [variable, names] : {std::pair("$tool", &tools_), std::pair("$base", &bases_)}) {
      const bool whole = lower(now_.name) == variable;
      if (!whole && now_.last[1] != variable) continue;
      std::size_t end = at + 1;
      for (int depth = 0; end < text_.size(); ++end) {
        const char c = text_[end];
        if (c == '\n' || c == ';' || (c == ',' && depth == 0)) break;
        depth += (c == '{' || c == '[' || c == '(') - (c == '}' || c == ']' || c == ')');
      }
      const std::string value = plain({at + 1, end});
      names->emplace(whole ? value : fmt::format("{}.{}={}", variable, lower(now_.name), value), at);
    }
  }

  /// {TYPE: NAME value, …} in one line: returns what stands behind it.
  std::size_t aggregate(std::size_t begin, std::size_t depth) {
    if (depth == deepest)
      throw error(begin, now_.assigned, fmt::format("at most {} aggregates in each other", deepest), "more");
    std::string type;
    Parts parts;
    int brackets = 0;
    std::size_t start = begin + 1;
    const auto part = [&](std::size_t end) {
      const TextSpan all = trimmed({start, end});
      const std::size_t word = end_of_word(all.begin);
      const std::string name = lower(text_.substr(all.begin, word - all.begin));
      const bool first = parts.emplace(name, trimmed({word, all.end})).second;
      if (!first && !name.empty())
        throw error(all.begin, now_.assigned, "each component once", name + " twice");
      start = end + 1;
    };
    std::size_t at = begin + 1;
    for (;;) {
      if (at >= text_.size() || text_[at] == '\n' || text_[at] == ';')
        throw error(begin, now_.assigned, "an aggregate that ends with } in its line", "none");
      const char c = text_[at];
      if (c == '"') {
        at = behind_string(at);
        continue;
      }
      if (c == '{') {
        at = aggregate(at, depth + 1);
        continue;
      }
      if (c == '}') break;
      if (c == '[' || c == '(') ++brackets;
      if (c == ']' || c == ')') --brackets;
      if (c == ',' && brackets == 0) part(at);
      if (c == ':' && type.empty() && parts.empty()) {
        type = plain({start, at});
        start = at + 1;
      }
      ++at;
    }
    part(at);
    take({begin, at + 1}, depth != 0, type, parts);
    return at + 1;
  }

  /// XP1:{…} or {…}:XP1
  bool is_operand(const TextSpan& all) const {
    std::size_t before = all.begin;
    while (before > 0 && (text_[before - 1] == ' ' || text_[before - 1] == '\t')) --before;
    const std::size_t behind = std::min(text_.find_first_not_of(" \t", all.end), text_.size() - 1);
    return (before > 0 && text_[before - 1] == ':') || text_[behind] == ':';
  }

  void take(const TextSpan& all, bool nested, const std::string& type, const Parts& parts) {
    static const std::array<const char*, joint_count> axes{"a1", "a2", "a3", "a4", "a5", "a6"};
    static const std::array<const char*, 6> pose{"x", "y", "z", "a", "b", "c"};
    const auto count = [&parts](const auto& names) {
      return std::count_if(names.begin(), names.end(), [&](const char* n) { return parts.count(n) != 0; });
    };
    for (auto& [part, names] : {std::pair("tool", &tools_), std::pair("base", &bases_)}) {
      if (const auto number = parts.find(fmt::format("{}_no", part)); number != parts.end())
        names->emplace(fmt::format("{}_data[{}]", part, plain(number->second)), all.begin);
    }
    const auto joints = count(axes);
    const auto needed = joints != 0 ? joints : count(pose);
    if (needed == 0) return;
    const std::size_t at = all.begin;
    const std::string& name = now_.assigned;
    if (now_.relative && !nested)
      throw error(at, name, "a target", "a relative move, which cannot be corrected by itself");

    // Nothing is known of what stands in an aggregate of the user's but what it says itself.
    std::string known = type;
    if (known.empty() && !nested) {
      const auto declared = declared_.find(lower(name));
      known = !now_.type.empty() ? now_.type : declared != declared_.end() ? declared->second : "";
    }
    const bool status = parts.count("s") != 0 || parts.count("t") != 0;
    const std::string small = lower(name);
    // $BASE, TOOL_DATA[1], $WORKSPACE …: where things are, not where to go.
    const bool system = small.starts_with('$') || small.ends_with("_data");
    bool target = false;
    if (joints != 0) {
      target = !system && (is_axes(known) || (!nested && (now_.moves() || !name.empty())));
    } else {
      // A base or a tool has a pose as well, but no status and no turn, and is called a FRAME.
      if (known == "frame" || (system && !status)) return;
      if (is_operand(all) && !nested)
        throw error(at, name, "a target",
                    "a part of a geometric operation (:), which cannot be corrected by itself");
      target = !system && (is_position(known) || status || (!nested && now_.moves()));
    }
    if (!target) {
      if (needed == 6)
        warn(at, fmt::format("{} {} left as it is, for nothing says that it is a target (a move, a type{})",
                             joints != 0 ? "{A1 … A6}" : "{X … C}",
                             name.empty() ? "is" : "of " + name + " is", joints != 0 ? "" : ", S or T"));
      return;
    }
    if (needed != 6) {
      throw error(at, name, joints != 0 ? "all of A1 … A6" : "all of X, Y, Z, A, B, C",
                  fmt::format("{} of them: the others are where the program left them", needed));
    }
    ProgramTarget found;
    found.line = line(at);
    found.name = name;
    if (joints != 0) {
      for (std::size_t j = 0; j < joint_count; ++j) {
        found.numbers.push_back(parts.at(axes[j]));
        found.q_rad[j] = number(found.numbers[j], unit::degree, axes[j]);
      }
    } else {
      found.pose = true;
      std::array<double, 6> v{};
      for (std::size_t k = 0; k < 6; ++k) {
        found.numbers.push_back(parts.at(pose[k]));
        v[k] = number(found.numbers[k], k < 3 ? unit::mm : unit::degree, pose[k]);
      }
      found.position_m = {v[0], v[1], v[2]};
      found.orientation = kuka_rotation({v[3], v[4], v[5]});
      if (const auto t = parts.find("t"); t != parts.end()) {
        found.turn_number = t->second;
        found.turn = turn(t->second);
      }
    }
    program_.targets.push_back(std::move(found));
  }

  /// A number, or 'B110' in binary, or '…H' in hexadecimal digits: 'H3F'.
  unsigned turn(const TextSpan& s) const {
    constexpr unsigned largest = 4095;  // six joints and six external axes
    const std::string word(view(s));
    if (word.size() > 3 && word.front() == '\'' && word.back() == '\'') {
      const unsigned base = word[1] == 'B' || word[1] == 'b' ? 2 : word[1] == 'H' || word[1] == 'h' ? 16 : 0;
      unsigned bits = 0;
      const char* const end = word.data() + word.size() - 1;
      const auto read = std::from_chars(word.data() + 2, end, bits, base == 0 ? 10 : static_cast<int>(base));
      if (base == 0 || read.ec != std::errc() || read.ptr != end || bits > largest)
        throw error(s.begin, "T", "a number, 'B…' or 'H…' of at most 12 bits", word);
      return bits;
    }
    const double value = number(s, unit::si, "T");
    if (value < 0 || value > largest || value != std::floor(value))
      throw error(s.begin, "T", "a number of at most 12 bits", word);
    return static_cast<unsigned>(value);
  }

  /// A target that is called by name in a relative move, or with the geometric operator, is no place in the base.
  void refuse_parts_of_moves() const {
    for (const ProgramTarget& target : program_.targets) {
      const auto part = parts_of_moves_.find(lower(target.name));
      if (target.name.empty() || part == parts_of_moves_.end()) continue;
      throw InputError(
          program_.path, target.line, target.name, "a target",
          fmt::format("a part of a relative move or of a geometric operation (line {}), which cannot be "
                      "corrected by itself",
                      line(part->second)));
    }
  }

  Statement now_;
  std::map<std::string, std::string> declared_;        ///< type by name
  std::map<std::string, std::size_t> parts_of_moves_;  ///< where, by name
  std::map<std::string, std::size_t> tools_;
  std::map<std::string, std::size_t> bases_;
};

// --- RAPID ---------------------------------------------------------------------------------------------------------------

class Rapid : public Source {
 public:
  using Source::Source;

  void read() {
    std::size_t at = 0;
    while (at < text_.size()) {
      const char c = text_[at];
      if (c == '!') {
        at = end_of_line(at);
      } else if (c == '"') {
        at = behind_string(at);
      } else if (c == '[') {
        const std::size_t begin = at;
        const Node list = parse(at, 0);
        now_.see(begin);
        take(list, calls_ == 0 ? Place::open : Place::argument);
      } else if (is_word(c)) {
        const std::size_t end = end_of_word(at);
        now_.see(at);
        word(at, end);
        at = end;
      } else {
        sign(at);
        ++at;
      }
    }
    warn_of_several_tools(tools_);
    warn_of_several("work objects", work_objects_, "All poses are taken in the one frame of --frame.");
  }

 private:
  /// [ … ], or what stands between two commas; a list inside of an expression is among its items.
  struct Node {
    TextSpan span;
    bool list = false;
    std::vector<Node> items;
  };
  enum class Place { open, argument };

  /// What stands since the last semicolon, outside of all brackets.
  struct Statement {
    std::string last;  ///< word, as written
    std::string type;  ///< of what is declared, small letters
    std::string name;  ///< of what is declared or assigned
    bool declares = false;
    bool assigns = false;
    bool option = false;  ///< behind a backslash
    std::string move;     ///< MoveL …, small letters
    std::vector<TextSpan> arguments;
    bool argument_begins = false;

    void see(std::size_t at) {
      if (!argument_begins) return;
      arguments.push_back({at, at});
      argument_begins = false;
    }
  };

  void skip_blanks(std::size_t& at) const {
    while (at < text_.size()) {
      if (text_[at] == '!') {
        at = end_of_line(at);
      } else if (is_blank(text_[at])) {
        ++at;
      } else {
        return;
      }
    }
  }

  /// [ … ] from `at`, which then stands behind it.
  Node parse(std::size_t& at, std::size_t depth) const {
    const std::size_t begin = at;
    if (depth == deepest)
      throw error(begin, now_.name, fmt::format("at most {} lists in each other", deepest), "more");
    Node list;
    list.list = true;
    ++at;
    for (;;) {
      skip_blanks(at);
      if (at >= text_.size() || text_[at] == ';')
        throw error(begin, now_.name, "a list that ends with ]", "none");
      if (text_[at] == ']') {
        list.span = {begin, ++at};
        return list;
      }
      if (text_[at] == ',') {
        ++at;
        continue;
      }
      list.items.push_back(item(at, depth));
    }
  }

  Node item(std::size_t& at, std::size_t depth) const {
    Node value;
    value.span = {at, at};
    int brackets = 0;
    while (at < text_.size() && text_[at] != ';') {
      const char c = text_[at];
      if (c == ']' || (c == ',' && brackets <= 0)) break;
      if (c == '!') {
        at = end_of_line(at);
        continue;
      }
      if (c == '[') {
        value.items.push_back(parse(at, depth + 1));
        value.span.end = at;
        continue;
      }
      const std::size_t next = c == '"' ? behind_string(at) : at + 1;
      brackets += (c == '(' || c == '{') - (c == ')' || c == '}');
      if (!is_blank(c)) value.span.end = next;
      at = next;
    }
    // A list and nothing else.
    if (value.items.size() == 1) {
      Node& only = value.items.front();
      if (only.span.begin == value.span.begin && only.span.end == value.span.end) {
        Node list = std::move(only);
        return list;
      }
    }
    return value;
  }

  static bool is_motion(const std::string& word) {
    static constexpr std::array<std::string_view, 14> motions{
        "moveabsj",  "movej",   "movel",   "movec", "triggj", "triggl", "triggc",
        "triggabsj", "searchl", "searchc", "arcl",  "arcc",   "spotl",  "spotj"};
    return std::any_of(motions.begin(), motions.end(),
                       [&word](std::string_view m) { return word.starts_with(m); });
  }

  void word(std::size_t begin, std::size_t end) {
    const std::string small = lower(text_.substr(begin, end - begin));
    if (calls_ != 0 || braces_ != 0) {
      if (braces_ == 0) now_.last = small;
      return;
    }
    now_.last = std::string(text_.substr(begin, end - begin));
    if (in_record_) {
      if (record_.empty()) {
        record_ = small;
      } else if (joint_types_.count(small) != 0) {
        joint_types_.insert(record_);
      }
      if (small == "endrecord") in_record_ = false;
    } else if (small == "record") {
      in_record_ = true;
      record_.clear();
    } else if (small == "const" || small == "pers" || small == "var") {
      now_.declares = true;
      now_.type.clear();
    } else if (now_.declares && now_.type.empty()) {
      now_.type = small;
    } else if (now_.declares && now_.name.empty()) {
      now_.name = now_.last;
      declared_[small] = now_.type;
    } else if (!now_.declares && !now_.assigns && !now_.option && is_motion(small)) {
      now_.move = small;
      now_.arguments.clear();
      now_.argument_begins = true;
    } else if (small == "pdispon" || small == "pdispset") {
      warn(begin, fmt::format("{} moves the poses that follow: they are taken where they stand.", now_.last));
    }
  }

  void sign(std::size_t at) {
    const char c = text_[at];
    const bool outside = calls_ == 0 && braces_ == 0;
    if (c == ';') {
      end_of_statement(at);
    } else if (c == '(') {
      call(at);
      ++calls_;
    } else if (c == ')') {
      calls_ = std::max(calls_ - 1, 0);
      now_.last.clear();
    } else if (c == '{') {
      ++braces_;
    } else if (c == '}') {
      braces_ = std::max(braces_ - 1, 0);
    } else if (c == '\\' && outside) {
      now_.option = true;
      now_.see(at);
    } else if (c == ',' && outside) {
      now_.option = false;
      if (!now_.move.empty()) now_.argument_begins = true;
    } else if (c == ':' && outside && at + 1 < text_.size() && text_[at + 1] == '=') {
      if (now_.option) {
        if (lower(now_.last) == "wobj" && !now_.move.empty()) work_object_ = at + 2;
      } else if (!now_.declares) {
        now_.assigns = true;
        now_.name = now_.last;
        now_.move.clear();
      }
    }
  }

  void call(std::size_t at) {
    const std::string function = lower(now_.last);
    if (function != "offs" && function != "reltool") return;
    if (!now_.move.empty())
      throw error(at, now_.last, "a target",
                  fmt::format("a relative move ({}), which cannot be corrected by itself", now_.last));
    warn(at, fmt::format("what {} gives is not corrected.", now_.last));
  }

  /// Until the next comma, option or semicolon.
  std::string name_at(std::size_t begin, std::size_t end) const {
    std::size_t stop = begin;
    for (int depth = 0; stop < end; ++stop) {
      const char c = text_[stop];
      depth += (c == '[' || c == '{' || c == '(') - (c == ']' || c == '}' || c == ')');
      if (depth == 0 && (c == ',' || c == '\\' || c == ';')) break;
    }
    return plain({begin, stop});
  }

  void end_of_statement(std::size_t at) {
    if (!now_.move.empty()) {
      std::vector<std::string> given;
      for (const TextSpan& a : now_.arguments) {
        if (text_[a.begin] != '\\') given.push_back(name_at(a.begin, at));
      }
      // MoveL point, speed, zone, tool …; MoveC has two points; elsewhere the tool is the last.
      const std::size_t place = !now_.move.starts_with("move")   ? given.size() - 1
                                : now_.move.starts_with("movec") ? 4
                                                                 : 3;
      if (place < given.size()) {
        tools_.emplace(given[place], at);
        work_objects_.emplace(work_object_ == 0 ? "wobj0" : name_at(work_object_, at), at);
      }
    }
    now_ = Statement();
    work_object_ = 0;
    calls_ = braces_ = 0;
  }

  bool is_number(const Node& n) const {
    return !n.list && n.items.empty() && parse_si(view(n.span), unit::si).has_value();
  }
  static bool holds(const Node& n, std::size_t count) {
    return n.list && n.items.size() == count &&
           std::none_of(n.items.begin(), n.items.end(), [](const Node& i) { return i.list; });
  }
  bool all_numbers(const Node& n) const {
    return std::all_of(n.items.begin(), n.items.end(),
                       [this](const Node& i) { return i.list ? all_numbers(i) : is_number(i); });
  }

  std::string known_type() const {
    if (now_.declares) return now_.type;
    const auto declared = now_.assigns ? declared_.find(lower(now_.name)) : declared_.end();
    return declared == declared_.end() ? "" : declared->second;
  }

  void take(const Node& list, Place place) {
    const auto& l = list.items;
    const bool joints = l.size() == 2 && holds(l[0], 6) && holds(l[1], 6);
    const bool pose = l.size() == 4 && holds(l[0], 3) && holds(l[1], 4) && holds(l[2], 4) && holds(l[3], 6);
    const std::string type = known_type();
    const bool moves = !now_.move.empty() && place == Place::open;
    if (pose && place == Place::argument) {
      warn(list.span.begin, "a robtarget that a function is given is left as it is.");
      return;
    }
    if (pose || (joints && place == Place::open && (moves || joint_types_.count(type) != 0))) {
      target(list, joints);
      return;
    }
    if (joints && all_numbers(list)) {
      warn(list.span.begin,
           fmt::format("[[6 numbers],[6 numbers]] {}left as it is, for nothing says that it is a "
                       "jointtarget.",
                       now_.name.empty() ? "is " : "of " + now_.name + " is "));
      return;
    }
    const bool any_list = std::any_of(l.begin(), l.end(), [](const Node& i) { return i.list; });
    const bool array = !l.empty() && l[0].list && !l[0].items.empty() && l[0].items[0].list;
    const bool of_targets = type == "robtarget" || type == "jointtarget";
    if (place == Place::open && !array &&
        ((of_targets && any_list) || (moves && any_list && (l.size() == 2 || l.size() == 4)))) {
      throw error(list.span.begin, now_.name,
                  "a target of numbers: [[3],[4],[4],[6]], or [[6],[6]] of joints",
                  fmt::format("'{}'", shortened(plain(list.span))));
    }
    if (place == Place::open && of_targets && !any_list && !l.empty()) {
      warn(list.span.begin, fmt::format("{} is made of other data and left as it is.", now_.name));
    }
    // An array or a record may hold targets; a tool, a speed … does not.
    for (const Node& inner : l) {
      if (inner.list) {
        take(inner, place);
      } else {
        for (const Node& in_expression : inner.items) take(in_expression, Place::argument);
      }
    }
  }

  void target(const Node& list, bool joints) {
    const auto& l = list.items;
    for (const Node& part : l) {
      for (const Node& n : part.items) {
        if (!is_number(n)) number(n.span, unit::si, joints ? "jointtarget" : "robtarget");
      }
    }
    const auto spans = [](const Node& n, std::size_t count) {
      std::vector<TextSpan> out;
      for (std::size_t k = 0; k < count; ++k) out.push_back(n.items[k].span);
      return out;
    };
    ProgramTarget found;
    const std::size_t where = l[0].items[0].span.begin;
    found.line = line(where);
    found.name = now_.name;
    found.numbers = spans(l[0], l[0].items.size());
    if (joints) {
      for (std::size_t j = 0; j < joint_count; ++j)
        found.q_rad[j] = number(found.numbers[j], unit::degree, fmt::format("rax_{}", j + 1));
    } else {
      found.pose = true;
      for (std::size_t k = 0; k < 3; ++k)
        found.position_m[static_cast<Eigen::Index>(k)] = number(found.numbers[k], unit::mm, "trans");
      std::array<double, 4> q{};
      const std::vector<TextSpan> rotation = spans(l[1], 4);
      for (std::size_t k = 0; k < 4; ++k) q[k] = number(rotation[k], unit::si, "rot");
      const auto unit = unit_quaternion(q);
      if (!unit) {
        throw error(where, found.name, "a quaternion of norm 1 (within 0.001)",
                    fmt::format("norm {:.6g}", Eigen::Quaterniond(q[0], q[1], q[2], q[3]).norm()));
      }
      found.orientation = *unit;
      found.numbers.insert(found.numbers.end(), rotation.begin(), rotation.end());
      found.quadrant_numbers = spans(l[2], 3);
      found.quadrant.emplace();
      for (std::size_t k = 0; k < 3; ++k) (*found.quadrant)[k] = whole(found.quadrant_numbers[k]);
      if (const int cfx = whole(l[2].items[3].span); cfx >= 0 && cfx < 8) found.cfx = cfx;
    }
    program_.targets.push_back(std::move(found));
  }

  int whole(const TextSpan& s) const {
    constexpr int most = 8;  // quarter turns: two full ones
    const double value = number(s, unit::si, "robconf");
    if (std::abs(value) > most || value != std::floor(value))
      throw error(s.begin, "robconf", "a whole number, -8 … 8", fmt::format("'{}'", view(s)));
    return static_cast<int>(value);
  }

  Statement now_;
  int calls_ = 0;
  int braces_ = 0;
  std::size_t work_object_ = 0;  ///< where its name stands in this statement
  bool in_record_ = false;
  std::string record_;
  std::map<std::string, std::string> declared_;       ///< type by name
  std::set<std::string> joint_types_{"jointtarget"};  ///< and records with one
  std::map<std::string, std::size_t> tools_;
  std::map<std::string, std::size_t> work_objects_;
};

// --- VAL 3 ---------------------------------------------------------------------------------------------------------------

class Val3 : public Source {
 public:
  using Source::Source;

  void read() {
    std::string name;
    std::string type;
    std::size_t cartesian = 0;
    for (std::size_t at = text_.find('<'); at < text_.size(); at = text_.find('<', at + 1)) {
      if (const auto end = behind_unread(at)) {
        at = *end - 1;
        continue;
      }
      const std::size_t end = end_of_tag(at);
      const std::string tag(text_.substr(at + 1, end_of_word(at + 1) - at - 1));
      if (text_.substr(at).starts_with("</Data>") || text_.substr(at).starts_with("</Data ")) {
        type.clear();
        name.clear();
      }
      const std::map<std::string, TextSpan> a = attributes(at, end);
      if (const auto n = a.find("name"); n != a.end()) name = std::string(view(n->second));
      if (tag == "Data") {
        const auto t = a.find("type");
        type = t == a.end() ? "" : std::string(view(t->second));
      }
      std::size_t there = 0;
      for (std::size_t j = 1; j <= joint_count; ++j) there += a.count(fmt::format("j{}", j));
      if (there == 0) {
        const bool at_place = a.count("x") != 0 && a.count("y") != 0 && a.count("z") != 0;
        if (at_place && (type.starts_with("point") || tag == "valuePoint" || a.count("shoulder") != 0))
          ++cartesian;
      } else if (type.starts_with("joint") || tag == "valueJoint") {
        if (there != joint_count) throw error(at, name, "all of j1 … j6", fmt::format("{} of them", there));
        target(at, name, a);
      } else if (there == joint_count) {
        warn(at,
             fmt::format("j1 … j6 of {} {} left as they are: no joint positions, by their type.",
                         name.empty() ? "<" + tag + ">" : name, type.empty() ? "are" : "(" + type + ") are"));
      }
      at = end - 1;
    }
    if (cartesian != 0) {
      program_.warnings.push_back(fmt::format(
          "{}: {} Cartesian points are left as they are: their configuration does not tell one solution; "
          "teach joint points.",
          program_.path, cartesian));
    }
  }

 private:
  /// Behind a comment, an instruction or what is no markup; nothing for a tag.
  std::optional<std::size_t> behind_unread(std::size_t at) const {
    for (const auto& [begin, end] : {std::pair<std::string_view, std::string_view>("<!--", "-->"),
                                     std::pair<std::string_view, std::string_view>("<![CDATA[", "]]>"),
                                     std::pair<std::string_view, std::string_view>("<?", "?>")}) {
      if (!text_.substr(at).starts_with(begin)) continue;
      const std::size_t found = text_.find(end, at + begin.size());
      if (found == std::string_view::npos) throw error(at, "", fmt::format("{} … {}", begin, end), "no end");
      return found + end.size();
    }
    return {};
  }

  /// Behind its >, which may stand in quotes before.
  std::size_t end_of_tag(std::size_t at) const {
    char quote = 0;
    for (std::size_t k = at + 1; k < text_.size(); ++k) {
      const char c = text_[k];
      if (quote != 0) {
        if (c == quote) quote = 0;
      } else if (c == '"' || c == '\'') {
        quote = c;
      } else if (c == '>') {
        return k + 1;
      }
    }
    throw error(at, "", "a tag that ends with >", "none");
  }

  void target(std::size_t at, const std::string& name, const std::map<std::string, TextSpan>& a) {
    ProgramTarget found;
    found.line = line(at);
    found.name = name;
    for (std::size_t j = 0; j < joint_count; ++j) {
      const std::string key = fmt::format("j{}", j + 1);
      found.numbers.push_back(a.at(key));
      found.q_rad[j] = number(a.at(key), unit::degree, key);
    }
    program_.targets.push_back(std::move(found));
  }

  std::map<std::string, TextSpan> attributes(std::size_t at, std::size_t end) const {
    std::map<std::string, TextSpan> out;
    std::size_t k = at + 1;
    while (k < end && !is_blank(text_[k])) ++k;
    while (k < end) {
      while (k < end && !is_word(text_[k])) ++k;
      const std::size_t start = k;
      while (k < end && text_[k] != '=' && !is_blank(text_[k])) ++k;
      const std::string name(text_.substr(start, k - start));
      k = std::min(text_.find_first_of("\"'", k), end);
      if (k >= end) break;
      const std::size_t close = text_.find(text_[k], k + 1);
      if (close >= end) break;
      if (!out.emplace(name, TextSpan{k + 1, close}).second)
        throw error(start, name, "each attribute once", "two");
      k = close + 1;
    }
    return out;
  }
};

std::string six_decimals(double value) {
  std::string text = fmt::format("{:.6f}", value);
  while (text.ends_with('0')) text.pop_back();
  if (text.ends_with('.')) text += '0';
  return text == "-0.0" ? "0.0" : text;
}

/// In the notation and with the digits of the word that it replaces.
std::string turn_word(unsigned turn, std::string_view old) {
  if (!old.starts_with('\'')) return fmt::format("{}", turn);
  const std::size_t digits = old.size() - 3;
  return old[1] == 'B' || old[1] == 'b' ? fmt::format("'{}{:0{}b}'", old[1], turn, digits)
                                        : fmt::format("'{}{:0{}X}'", old[1], turn, digits);
}

/// A, B, C of Rot(z,a) Rot(y,b) Rot(x,c); where b is a right angle c makes up for a.
Eigen::Vector3d kuka_angles(const Eigen::Matrix3d& r) {
  const double a = std::atan2(r(1, 0), r(0, 0));
  const double s = std::sin(a);
  const double c = std::cos(a);
  return {a, std::atan2(-r(2, 0), c * r(0, 0) + s * r(1, 0)),
          std::atan2(s * r(0, 2) - c * r(1, 2), c * r(1, 1) - s * r(0, 1))};
}

}  // namespace

std::optional<ProgramLanguage> program_language(const std::string& path) {
  const std::string ending = lower(std::filesystem::path(path).extension().string());
  if (ending == ".src") return ProgramLanguage::kuka;
  // Tables are called .dat as well; they have no braces.
  if (ending == ".dat" && read_file(path).find('{') != std::string::npos) return ProgramLanguage::kuka;
  if (ending == ".mod" || ending == ".modx" || ending == ".prg" || ending == ".sys")
    return ProgramLanguage::rapid;
  if (ending == ".dtx") return ProgramLanguage::val3;
  return {};
}

TargetProgram read_program(const std::string& path, ProgramLanguage language) {
  TargetProgram program;
  program.path = path;
  program.language = language;
  program.text = read_file(path);
  switch (language) {
    case ProgramLanguage::kuka:
      Krl(program).read();
      break;
    case ProgramLanguage::rapid:
      Rapid(program).read();
      break;
    case ProgramLanguage::val3:
      Val3(program).read();
  }
  if (program.targets.empty()) {
    const char* const expected = language == ProgramLanguage::kuka
                                     ? "targets: {A1 …, A6 …} or {X …, Y …, Z …, A …, B …, C …, S …, T …}"
                                 : language == ProgramLanguage::rapid
                                     ? "targets: [[six angles],[…]] or [[x,y,z],[quaternion],[robconf],[…]]"
                                     : "targets: <Value j1=… j6=…/>";
    throw InputError(path, 0, "", expected, "none");
  }
  return program;
}

std::string program_text(const TargetProgram& program, const std::vector<ProgramTarget>& corrected) {
  std::map<std::size_t, std::pair<std::size_t, std::string>> edits;
  const auto put = [&edits](const TextSpan& span, const std::string& text) {
    edits[span.begin] = {span.end, text};
  };
  for (std::size_t n = 0; n < corrected.size(); ++n) {
    const ProgramTarget& t = corrected[n];
    const ProgramTarget& old = program.targets[n];
    if (!t.pose) {
      for (std::size_t j = 0; j < joint_count; ++j) put(t.numbers[j], six_decimals(degrees(t.q_rad[j])));
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k)
      put(t.numbers[k], six_decimals(t.position_m[static_cast<Eigen::Index>(k)] * 1e3));
    if (program.language == ProgramLanguage::kuka) {
      const Eigen::Vector3d abc = kuka_angles(t.orientation.toRotationMatrix());
      for (std::size_t k = 0; k < 3; ++k)
        put(t.numbers[3 + k], six_decimals(degrees(abc[static_cast<Eigen::Index>(k)])));
    } else {
      const Eigen::Quaterniond& q = t.orientation;
      const std::array<double, 4> wxyz{q.w(), q.x(), q.y(), q.z()};
      // 1e-9 of a quaternion is what 1e-6 deg is of an angle.
      for (std::size_t k = 0; k < 4; ++k) put(t.numbers[3 + k], fmt::format("{:.9f}", wxyz[k]));
    }
    // A word that is right stays as it is written.
    if (t.turn && t.turn_number && t.turn != old.turn) {
      const std::string_view word =
          std::string_view(program.text)
              .substr(t.turn_number->begin, t.turn_number->end - t.turn_number->begin);
      put(*t.turn_number, turn_word(*t.turn, word));
    }
    for (std::size_t k = 0; k < t.quadrant_numbers.size(); ++k) {
      if ((*t.quadrant)[k] != (*old.quadrant)[k])
        put(t.quadrant_numbers[k], fmt::format("{}", (*t.quadrant)[k]));
    }
  }
  std::string out;
  std::size_t at = 0;
  for (const auto& [begin, edit] : edits) {
    out.append(program.text, at, begin - at);
    out += edit.second;
    at = edit.first;
  }
  return out.append(program.text, at);
}

unsigned turn_of(const std::array<double, joint_count>& q_rad, unsigned before) {
  for (std::size_t j = 0; j < joint_count; ++j) {
    const unsigned bit = 1U << j;
    if (std::abs(q_rad[j]) > word_edge_rad) before = q_rad[j] < 0 ? before | bit : before & ~bit;
  }
  return before;
}

std::array<int, 3> quadrants_of(const std::array<double, joint_count>& q_rad, std::array<int, 3> before) {
  constexpr std::array<std::size_t, 3> joints{0, 3, 5};
  for (std::size_t k = 0; k < 3; ++k) {
    const double quarters = q_rad[joints[k]] / (pi / 2);
    const double edge = word_edge_rad / (pi / 2);
    if (quarters < before[k] - edge || quarters > before[k] + 1 + edge)
      before[k] = static_cast<int>(std::floor(quarters));
  }
  return before;
}

bool words_fit(const ProgramTarget& target, const std::array<double, joint_count>& q_rad) {
  return (!target.turn || turn_of(q_rad, *target.turn) == *target.turn) &&
         (!target.quadrant || quadrants_of(q_rad, *target.quadrant) == *target.quadrant);
}

}  // namespace flexcomp::host
