// SPDX-License-Identifier: Apache-2.0
/// \file
/// Joint commands of a program's targets, and the program with other commands.
#ifndef FLEXCOMP_HOST_EXCHANGE_PROGRAM_COMMANDS_HPP
#define FLEXCOMP_HOST_EXCHANGE_PROGRAM_COMMANDS_HPP

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "exchange/target_program.hpp"
#include "flexcomp/linear.hpp"
#include "model/robot.hpp"
#include "model/targets.hpp"

namespace flexcomp::host {

/// The targets as joint commands, poses by the nominal inverse kinematics of the robot's tool. Of several solutions those that
/// the target's words (turn, quadrants, then cfx) name; of what remains the nearest to the command before, at first to `start`.
/// `frame` is F0 as seen from the frame of the program's poses.
/// \throws InputError  path:line: name: a pose that is not reached as its words say; several solutions without `start`
TargetsFile program_commands(const TargetProgram& program, const Robot& robot, const Pose<double>& frame,
                             const std::optional<std::array<double, joint_count>>& start,
                             const std::function<void(std::size_t done, std::size_t of)>& progress);

/// The program with these commands for its targets: a pose becomes the one to which they bring the nominal kinematics.
std::string with_commands(const TargetProgram& program, const Robot& robot, const Pose<double>& frame,
                          const std::vector<std::array<double, joint_count>>& q_rad);

}  // namespace flexcomp::host

#endif
