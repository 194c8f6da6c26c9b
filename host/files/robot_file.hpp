// SPDX-License-Identifier: Apache-2.0
/// \file
/// Reads and writes robot files (docs/files.md).
#ifndef FLEXCOMP_HOST_FILES_ROBOT_FILE_HPP
#define FLEXCOMP_HOST_FILES_ROBOT_FILE_HPP

#include <string>
#include <vector>

#include "model/robot.hpp"

namespace flexcomp::host {

/// Links longer than any arm's: d that ran off. Where two axes are nearly parallel, a maker's table of calibrated
/// Denavit-Hartenberg parameters holds hundreds of metres of d on one link and as much against it on the next; nothing can
/// be identified from there.
constexpr double longest_link_m = 20;
enum class LongLinks { refused, taken };

/// Reads and checks a robot file.
/// \throws InputError  file absent or no YAML; a key that is unknown (with the nearest known one), missing, given twice
///                     or of the wrong kind; not six joints; a number that is not finite; min >= max; a quaternion
///                     whose norm is off 1 by more than 1e-3; |d| or |a| above longest_link_m
Robot load_robot(const std::string& path, LongLinks long_links = LongLinks::refused);

/// The same from the text of a robot file; `name` stands for its path in messages.
Robot parse_robot(const std::string& text, const std::string& name);

/// A robot file from which load_robot() gives the identical robot back; what is unknown or absent is left out. `comment`
/// goes before it, as lines without their #.
std::string robot_text(const Robot& robot, const std::vector<std::string>& comment);

}  // namespace flexcomp::host

#endif
