// SPDX-License-Identifier: Apache-2.0
/// \file
/// The nominal robot as source text for a controller.
#pragma once

#include <string>
#include <string_view>

#include "model/robot.hpp"

namespace flexcomp::host {

/// The robot's name as a C identifier that is no keyword of C or C++: "staubli-tx60l" becomes "staubli_tx60l".
std::string c_identifier(std::string_view name);

/// A header with one constant of type flexcomp_robot (flexcomp.h), for C and for C++. Its numbers are the shortest
/// decimals that read back to the very doubles of `robot`, so a controller that is built with it has the same nominal
/// hash. What a controller does not use (reflectors, bodies, speeds) is left out.
std::string robot_header(const Robot& robot, const std::string& made_by = "flexcomp");

}  // namespace flexcomp::host
