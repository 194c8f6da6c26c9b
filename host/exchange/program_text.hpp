// SPDX-License-Identifier: Apache-2.0
/// \file
/// What the readers of all robot languages share, and the readers: each puts what it finds into the program's targets and
/// warnings, and throws InputError (file:line) on a target that it does not understand.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "exchange/target_program.hpp"
#include "files/text.hpp"
#include "input_error.hpp"
#include "units.hpp"

namespace flexcomp::host {

void read_krl(TargetProgram& program);    ///< KUKA
void read_rapid(TargetProgram& program);  ///< ABB
void read_val3(TargetProgram& program);   ///< Stäubli

/// Brackets in brackets: no target of any of the languages needs more.
constexpr std::size_t deepest_brackets = 8;

/// For people, of text that may be long.
inline std::string shortened(std::string_view text) {
  constexpr std::size_t most = 40;
  return text.size() <= most ? std::string(text) : std::string(text.substr(0, most)) + "…";
}

/// A program as its readers see it: characters with their lines, and the pieces that all languages have.
class ProgramText {
 public:
  explicit ProgramText(TargetProgram& program) : program_(program), text_(program.text) {
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
  /// A letter, a digit, _ or $.
  static bool is_word(char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '$';
  }
  /// Also the end of a line.
  static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

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

}  // namespace flexcomp::host
