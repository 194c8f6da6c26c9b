// SPDX-License-Identifier: Apache-2.0
/// \file
/// Colour on a terminal, and nothing but the text anywhere else: in a pipe, in a file, where NO_COLOR is set
/// (no-color.org) or the terminal is a dumb one.
#pragma once

#include <string>

namespace flexcomp::host {

enum class Colour { head, good, bad, note };

/// Whether this stream (STDOUT_FILENO, STDERR_FILENO) is shown in colour.
bool coloured(int stream);

/// The text in a colour where the stream is shown so, else the text. Colour goes around what is already padded: columns stay
/// where they are.
std::string painted(const std::string& text, Colour colour, int stream);

/// A line "label text" on standard error. Never throws: where that is full, the exit status still says it.
void print_message(const std::string& label, Colour colour, const std::string& text);

}  // namespace flexcomp::host
