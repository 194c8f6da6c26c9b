// SPDX-License-Identifier: Apache-2.0
#include "commands/colour.hpp"

#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string_view>

namespace flexcomp::host {

bool coloured(int stream) {
  const char* const no_colour = std::getenv("NO_COLOR");
  if (no_colour != nullptr && *no_colour != '\0') return false;
  const char* const terminal = std::getenv("TERM");
  if (terminal == nullptr || *terminal == '\0' || std::string_view(terminal) == "dumb") return false;
  return ::isatty(stream) == 1;
}

std::string painted(const std::string& text, Colour colour, int stream) {
  if (!coloured(stream)) return text;
  const char* code = "\033[1m";
  if (colour == Colour::good) code = "\033[32m";
  if (colour == Colour::bad) code = "\033[31m";
  if (colour == Colour::note) code = "\033[33m";
  return code + text + "\033[0m";
}

void print_message(const std::string& label, Colour colour, const std::string& text) {
  std::fputs((painted(label, colour, STDERR_FILENO) + " " + text + "\n").c_str(), stderr);
}

}  // namespace flexcomp::host
