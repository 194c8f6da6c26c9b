// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "exchange/program_text.hpp"
#include "exchange/rotation_angles.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

class Krl : public ProgramText {
 public:
  using ProgramText::ProgramText;

  void read() {
    for (std::size_t at = 0; at < text_.size(); ++at) at = statement(at);
    refuse_parts_of_moves();
    warn_of_several_tools(tools_);
    warn_of_several("bases", bases_, "All poses are taken in one frame.");
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
    if (depth == deepest_brackets)
      throw error(begin, now_.assigned, fmt::format("at most {} aggregates in each other", deepest_brackets),
                  "more");
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
    for (const auto& [part, value] : parts) {
      const bool own = std::find(axes.begin(), axes.end(), part) != axes.end();
      const bool of_pose =
          std::find(pose.begin(), pose.end(), part) != pose.end() || part == "s" || part == "t";
      const bool external = part.size() == 2 && part[0] == 'e' && part[1] >= '1' && part[1] <= '6';
      if (external || (joints != 0 ? own : of_pose)) continue;
      throw error(at, name,
                  joints != 0 ? "A1 … A6 and E1 … E6 alone" : "X, Y, Z, A, B, C, S, T and E1 … E6 alone",
                  fmt::format("\"{}\" (a decimal comma?)", part.empty() ? plain(value) : part));
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

}  // namespace

void read_krl(TargetProgram& program) { Krl(program).read(); }

}  // namespace flexcomp::host
