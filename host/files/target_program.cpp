#include "files/target_program.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <string_view>
#include <utility>

#include "files/input_error.hpp"
#include "files/point_list.hpp"
#include "files/quaternion.hpp"
#include "files/read_file.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

using Span = ProgramTarget::Span;

std::string lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '$'; }
bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

class Source {
 public:
  explicit Source(TargetProgram& program) : program_(program), text_(program.text) {}

  std::size_t line(std::size_t at) const {
    return 1 + static_cast<std::size_t>(
                   std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
  }
  std::string_view view(const Span& s) const { return text_.substr(s.begin, s.end - s.begin); }
  InputError error(std::size_t at, const std::string& field, const std::string& expected,
                   const std::string& found) const {
    return {program_.path, line(at), field, expected, found};
  }
  double number(const Span& s, const Unit& unit, const std::string& field) const {
    if (const auto value = parse_si(view(s), unit)) return *value;
    throw error(s.begin, field, "a finite number", fmt::format("'{}'", view(s)));
  }
  /// The word that ends before `at`, blanks left out.
  std::string word_before(std::size_t at) const {
    const auto skip_blanks = [this, &at] {
      while (at > 0 && is_blank(text_[at - 1])) --at;
    };
    skip_blanks();
    // The size of an array: name{3} or name[3].
    if (at > 0 && (text_[at - 1] == '}' || text_[at - 1] == ']')) {
      const auto open = text_.find_last_of("{[", at - 1);
      if (open != std::string_view::npos) at = open;
      skip_blanks();
    }
    const std::size_t end = at;
    while (at > 0 && is_word(text_[at - 1])) --at;
    return std::string(text_.substr(at, end - at));
  }
  std::string_view line_before(std::size_t at) const {
    const auto start = text_.rfind('\n', at == 0 ? 0 : at - 1);
    const std::size_t begin = start == std::string_view::npos ? 0 : start + 1;
    return text_.substr(begin, at - begin);
  }

 protected:
  TargetProgram& program_;
  std::string_view text_;
};

// --- KRL -----------------------------------------------------------------------------------------------------------------

class Krl : public Source {
 public:
  using Source::Source;

  void read() {
    bool comment = false;
    bool quoted = false;
    for (std::size_t at = 0; at < text_.size(); ++at) {
      const char c = text_[at];
      if (c == '\n') {
        comment = quoted = false;
      } else if (c == '"') {
        quoted = !quoted;
      } else if (!quoted && (c == ';' || (c == '&' && line_before(at).empty()))) {
        comment = true;
      } else if (!comment && !quoted && c == '{') {
        at = aggregate(at);
      }
    }
  }

 private:
  /// {TYPE: NAME value, …}: returns where it ends.
  std::size_t aggregate(std::size_t begin) {
    const std::size_t end = text_.find_first_of("{}\n", begin + 1);
    if (end == std::string_view::npos || text_[end] != '}') return begin;
    std::size_t at = begin + 1;
    std::string type;
    const std::size_t colon = text_.find(':', at);
    if (colon < end) {
      type = lower(word_before(colon));
      at = colon + 1;
    }
    std::map<std::string, Span> parts;
    while (at < end) {
      const std::size_t comma = std::min(text_.find(',', at), end);
      std::size_t start = at;
      while (start < comma && is_blank(text_[start])) ++start;
      std::size_t word = start;
      while (word < comma && is_word(text_[word])) ++word;
      Span value{word, comma};
      while (value.begin < value.end && is_blank(text_[value.begin])) ++value.begin;
      while (value.end > value.begin && is_blank(text_[value.end - 1])) --value.end;
      parts[lower(text_.substr(start, word - start))] = value;
      at = comma + 1;
    }
    take(begin, type, parts);
    return end;
  }

  void take(std::size_t at, const std::string& type, const std::map<std::string, Span>& parts) {
    static const std::array<const char*, joint_count> axes{"a1", "a2", "a3", "a4", "a5", "a6"};
    static const std::array<const char*, 6> pose{"x", "y", "z", "a", "b", "c"};
    const auto count = [&parts](const auto& names) {
      return std::count_if(names.begin(), names.end(), [&](const char* n) { return parts.count(n) != 0; });
    };
    const auto joints = count(axes);
    const auto coordinates = count(pose);
    const std::string before = lower(line_before(at));
    const bool equals = before.find('=') != std::string::npos;
    const std::string declared = fmt::format(" {} ", before);
    const auto says = [&](const char* word) {
      return declared.find(fmt::format(" {} ", word)) != std::string::npos;
    };
    const bool moves =
        says("ptp") || says("lin") || says("sptp") || says("slin") || says("circ") || says("scirc");
    const bool relative =
        says("ptp_rel") || says("lin_rel") || says("circ_rel") || says("sptp_rel") || says("slin_rel");
    if (joints == 0 && coordinates == 0) return;
    // A base or a tool has a pose as well, but no status and no turn, and is called a FRAME.
    const bool is_pose =
        joints == 0 && type != "frame" && !says("frame") &&
        (type == "e6pos" || type == "pos" || says("e6pos") || says("pos") || moves || parts.count("t") != 0);
    if (joints == 0 && !is_pose && !relative) return;
    std::string name = equals ? word_before(at - before.size() + before.rfind('=')) : "";
    if (relative) throw error(at, name, "a target", "a relative move, which cannot be corrected by itself");
    const auto needed = joints != 0 ? joints : coordinates;
    if (needed != 6) {
      throw error(at, name, joints != 0 ? "all of A1 … A6" : "all of X, Y, Z, A, B, C",
                  fmt::format("{} of them: the others are where the program left them", needed));
    }
    ProgramTarget target;
    target.line = line(at);
    target.name = std::move(name);
    if (joints != 0) {
      for (std::size_t j = 0; j < joint_count; ++j) {
        target.numbers.push_back(parts.at(axes[j]));
        target.q_rad[j] = number(target.numbers[j], unit::degree, axes[j]);
      }
    } else {
      target.pose = true;
      std::array<double, 6> v{};
      for (std::size_t k = 0; k < 6; ++k) {
        target.numbers.push_back(parts.at(pose[k]));
        v[k] = number(target.numbers[k], k < 3 ? unit::mm : unit::degree, pose[k]);
      }
      target.position_m = {v[0], v[1], v[2]};
      target.orientation = kuka_rotation({v[3], v[4], v[5]});
      if (const auto t = parts.find("t"); t != parts.end()) {
        target.turn_number = t->second;
        target.turn = turn(t->second);
      }
    }
    program_.targets.push_back(std::move(target));
  }

  /// A number, or 'B110' in binary.
  unsigned turn(const Span& s) const {
    std::string word(view(s));
    if (word.size() > 3 && (word.starts_with("'B") || word.starts_with("'b")) && word.ends_with('\'')) {
      unsigned bits = 0;
      for (const char c : word.substr(2, word.size() - 3)) {
        if (c != '0' && c != '1') throw error(s.begin, "T", "a number or 'B…'", word);
        bits = 2 * bits + (c == '1' ? 1U : 0U);
      }
      return bits;
    }
    const double value = number(s, unit::si, "T");
    if (value < 0 || value > 4095 || value != std::floor(value))
      throw error(s.begin, "T", "a number of bits", word);
    return static_cast<unsigned>(value);
  }
};

// --- RAPID ---------------------------------------------------------------------------------------------------------------

class Rapid : public Source {
 public:
  using Source::Source;

  void read() {
    bool comment = false;
    bool quoted = false;
    for (std::size_t at = 0; at < text_.size(); ++at) {
      const char c = text_[at];
      if (c == '\n') {
        comment = quoted = false;
      } else if (c == '"' && !comment) {
        quoted = !quoted;
      } else if (c == '!' && !quoted) {
        comment = true;
      } else if (!comment && !quoted && c == '[') {
        List list;
        const std::size_t begin = at;
        if (!parse(at, list)) continue;
        take(begin, list);
        --at;
      }
    }
  }

 private:
  struct List {
    std::vector<List> lists;
    std::vector<Span> values;  ///< what stands between commas and is no list
    bool numbers = true;
  };

  /// [ … ] from `at`, which then stands behind it. False where it has no end.
  bool parse(std::size_t& at, List& list) const {
    std::size_t k = at + 1;
    for (;;) {
      while (k < text_.size() && (is_blank(text_[k]) || text_[k] == ',')) ++k;
      if (k >= text_.size()) return false;
      if (text_[k] == ']') {
        at = k + 1;
        return true;
      }
      if (text_[k] == '[') {
        list.lists.emplace_back();
        if (!parse(k, list.lists.back())) return false;
        continue;
      }
      Span value{k, k};
      while (k < text_.size() && text_[k] != ',' && text_[k] != ']' && text_[k] != '[' && text_[k] != ';')
        ++k;
      if (k >= text_.size() || text_[k] == ';') return false;
      value.end = k;
      while (value.end > value.begin && is_blank(text_[value.end - 1])) --value.end;
      list.numbers = list.numbers && parse_si(view(value), unit::si).has_value();
      list.values.push_back(value);
    }
  }

  static bool is(const List& list, std::size_t numbers) {
    return list.lists.empty() && list.numbers && list.values.size() == numbers;
  }

  void take(std::size_t at, const List& list) {
    const auto& l = list.lists;
    const bool joints = list.values.empty() && l.size() == 2 && is(l[0], 6) && is(l[1], 6);
    const bool pose =
        list.values.empty() && l.size() == 4 && is(l[0], 3) && is(l[1], 4) && is(l[2], 4) && is(l[3], 6);
    if (!joints && !pose) {
      // An array of targets is a list of them; anything else is a tool, a speed …
      for (const List& inner : l) {
        if (list.values.empty()) take(at, inner);
      }
      return;
    }
    ProgramTarget target;
    const std::size_t where = l[0].values[0].begin;
    target.line = line(where);
    const std::string before(line_before(at));
    if (const auto assigned = before.rfind(":="); assigned != std::string::npos)
      target.name = word_before(at - before.size() + assigned);
    target.numbers = l[0].values;
    if (joints) {
      for (std::size_t j = 0; j < joint_count; ++j)
        target.q_rad[j] = number(l[0].values[j], unit::degree, fmt::format("rax_{}", j + 1));
    } else {
      target.pose = true;
      target.numbers.insert(target.numbers.end(), l[1].values.begin(), l[1].values.end());
      for (Eigen::Index k = 0; k < 3; ++k)
        target.position_m[k] = number(l[0].values[static_cast<std::size_t>(k)], unit::mm, "trans");
      std::array<double, 4> q{};
      for (std::size_t k = 0; k < 4; ++k) q[k] = number(l[1].values[k], unit::si, "rot");
      const auto unit = unit_quaternion(q);
      if (!unit) {
        throw error(where, target.name, "a quaternion of norm 1 (within 0.001)",
                    fmt::format("norm {:.6g}", Eigen::Quaterniond(q[0], q[1], q[2], q[3]).norm()));
      }
      target.orientation = *unit;
      target.quadrant.emplace();
      for (std::size_t k = 0; k < 3; ++k)
        (*target.quadrant)[k] = static_cast<int>(std::lround(number(l[2].values[k], unit::si, "robconf")));
      target.quadrant_numbers.assign(l[2].values.begin(), l[2].values.begin() + 3);
    }
    program_.targets.push_back(std::move(target));
  }
};

// --- VAL 3 ---------------------------------------------------------------------------------------------------------------

class Val3 : public Source {
 public:
  using Source::Source;

  void read() {
    std::string name;
    std::size_t cartesian = 0;
    for (std::size_t at = text_.find('<'); at < text_.size(); at = text_.find('<', at + 1)) {
      if (text_.substr(at).starts_with("<!--")) {
        const auto end = text_.find("-->", at);
        if (end == std::string_view::npos) break;
        at = end;
        continue;
      }
      const std::size_t end = text_.find('>', at);
      if (end == std::string_view::npos) break;
      const std::map<std::string, Span> a = attributes(at, end);
      if (const auto n = a.find("name"); n != a.end()) name = std::string(view(n->second));
      std::size_t there = 0;
      for (std::size_t j = 1; j <= joint_count; ++j) there += a.count(fmt::format("j{}", j));
      if (there == 0) {
        if (a.count("x") != 0 && a.count("rx") != 0 && a.count("shoulder") != 0) ++cartesian;
        continue;
      }
      if (there != joint_count) throw error(at, name, "all of j1 … j6", fmt::format("{} of them", there));
      ProgramTarget target;
      target.line = line(at);
      target.name = name;
      for (std::size_t j = 0; j < joint_count; ++j) {
        const std::string key = fmt::format("j{}", j + 1);
        target.numbers.push_back(a.at(key));
        target.q_rad[j] = number(a.at(key), unit::degree, key);
      }
      program_.targets.push_back(std::move(target));
    }
    if (cartesian != 0) {
      program_.warnings.push_back(fmt::format(
          "{}: {} Cartesian points are left as they are: their configuration does not tell one solution; "
          "teach joint points.",
          program_.path, cartesian));
    }
  }

 private:
  std::map<std::string, Span> attributes(std::size_t at, std::size_t end) const {
    std::map<std::string, Span> out;
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
      out[name] = {k + 1, close};
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
  const auto put = [&edits](const Span& span, const std::string& text) {
    edits[span.begin] = {span.end, text};
  };
  for (const ProgramTarget& t : corrected) {
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
    if (t.turn && t.turn_number) put(*t.turn_number, fmt::format("{}", *t.turn));
    for (std::size_t k = 0; k < t.quadrant_numbers.size(); ++k)
      put(t.quadrant_numbers[k], fmt::format("{}", (*t.quadrant)[k]));
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

unsigned turn_of(const std::array<double, joint_count>& q_rad) {
  unsigned bits = 0;
  for (std::size_t j = 0; j < joint_count; ++j) {
    if (q_rad[j] < 0) bits |= 1U << j;
  }
  return bits;
}

std::array<int, 3> quadrants_of(const std::array<double, joint_count>& q_rad) {
  std::array<int, 3> out{};
  const std::array<std::size_t, 3> joints{0, 3, 5};
  for (std::size_t k = 0; k < 3; ++k) out[k] = static_cast<int>(std::floor(q_rad[joints[k]] / (pi / 2)));
  return out;
}

}  // namespace flexcomp::host
