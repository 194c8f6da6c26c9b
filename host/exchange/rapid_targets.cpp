// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "exchange/program_text.hpp"
#include "quaternion.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

class Rapid : public ProgramText {
 public:
  using ProgramText::ProgramText;

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
    warn_of_several("work objects", work_objects_, "All poses are taken in one frame.");
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
    if (depth == deepest_brackets)
      throw error(begin, now_.name, fmt::format("at most {} lists in each other", deepest_brackets), "more");
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
      if (!unit) throw error(where, found.name, unit_quaternion_rule, norm_text(q));
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

}  // namespace

void read_rapid(TargetProgram& program) { Rapid(program).read(); }

}  // namespace flexcomp::host
