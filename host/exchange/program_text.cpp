// SPDX-License-Identifier: Apache-2.0
#include "exchange/program_text.hpp"

#include <cctype>

namespace flexcomp::host {

bool ProgramText::is_word(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '$';
}
bool ProgramText::is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

std::string shortened(std::string_view text) {
  constexpr std::size_t most = 40;
  return text.size() <= most ? std::string(text) : std::string(text.substr(0, most)) + "…";
}

}  // namespace flexcomp::host
