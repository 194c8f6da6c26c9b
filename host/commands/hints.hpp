// SPDX-License-Identifier: Apache-2.0
/// \file
/// Errors as the terminal shows them: with the options that are concerned, and what to do next.
#pragma once

#include <CLI/CLI.hpp>
#include <exception>
#include <string>
#include <vector>

#include "errors.hpp"

namespace flexcomp::host {

/// The message of an error, completed by the options that its code concerns.
std::string message(const std::exception& error);
/// The same for an argument that does not suit: as if the option were wrong.
CLI::ValidationError usage_error(const ArgumentError& error);

/// One line without full stop, or empty where the message says all that can be said. `command` is the one that failed: what
/// it does itself is no advice.
std::string hint(const std::exception& error, const std::string& command);

/// For a command line that was not understood: the nearest command or option, and whose help to read.
std::string usage_hint(const CLI::App& app, const std::vector<std::string>& arguments);

}  // namespace flexcomp::host
