// SPDX-License-Identifier: Apache-2.0
/// \file
/// Reads and writes robot files (docs/files.md).
#pragma once

#include <string>
#include <vector>

#include "model/robot.hpp"

namespace flexcomp::host {

/// Limit of |d| and |a|. With nearly parallel axes a table of calibrated Denavit-Hartenberg parameters has hundreds of
/// metres of d on one link, cancelled on the next; such a chain is too ill-conditioned for identification.
constexpr double longest_link_m = 20;
enum class LongLinks { refused, taken };

/// Reads and checks a robot file.
/// \throws InputError  file absent or no YAML; a key that is unknown (with the nearest known one), missing, given twice
///                     or of the wrong kind; not six joints; a number that is not finite; min >= max; a quaternion
///                     whose norm is off 1 by more than 1e-3; |d| or |a| above longest_link_m
Robot load_robot(const std::string& path, LongLinks long_links = LongLinks::refused);

/// Parses the text of a robot file. \param name  its path in messages
Robot parse_robot(const std::string& text, const std::string& name);

/// Formats a robot file, from which load_robot() reads the identical robot; unknown and absent values are left out.
/// \param comment  lines before it, without their #
std::string robot_text(const Robot& robot, const std::vector<std::string>& comment);

}  // namespace flexcomp::host
