// SPDX-License-Identifier: Apache-2.0
/// \file
/// What a new parameter set changes, as text for the terminal.
#ifndef FLEXCOMP_HOST_COMMANDS_DIFFERENCE_TEXT_HPP
#define FLEXCOMP_HOST_COMMANDS_DIFFERENCE_TEXT_HPP

#include <string>

#include "model/set_difference.hpp"

namespace flexcomp::host {

/// A line for each parameter that changes, and what all of them do at the tool.
std::string difference_table(const SetDifference& d);

}  // namespace flexcomp::host

#endif
