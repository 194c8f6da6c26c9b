// SPDX-License-Identifier: Apache-2.0
/// \file
/// A plan as text for the terminal.
#ifndef FLEXCOMP_HOST_COMMANDS_PLAN_TEXT_HPP
#define FLEXCOMP_HOST_COMMANDS_PLAN_TEXT_HPP

#include <string>
#include <vector>

#include "planning/plan_result.hpp"

namespace flexcomp::host {

std::vector<std::string> text_lines(const PlanTask& task, const PlanResult& result,
                                    const std::string& output);
/// The methods beside each other.
std::vector<std::string> comparison_lines(const PlanResult& result);

}  // namespace flexcomp::host

#endif
