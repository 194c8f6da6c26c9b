// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "exchange/program_text.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

class Val3 : public ProgramText {
 public:
  using ProgramText::ProgramText;

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
    const std::size_t close = tag_close(text_, at + 1);
    if (close == std::string_view::npos) throw error(at, "", "a tag that ends with >", "none");
    return close + 1;
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

}  // namespace

void read_val3(TargetProgram& program) { Val3(program).read(); }

}  // namespace flexcomp::host
