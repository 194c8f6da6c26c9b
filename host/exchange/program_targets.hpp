// SPDX-License-Identifier: Apache-2.0
/// \file
/// A robot program's targets as joint commands, and the program with its targets corrected.
#ifndef FLEXCOMP_HOST_EXCHANGE_PROGRAM_TARGETS_HPP
#define FLEXCOMP_HOST_EXCHANGE_PROGRAM_TARGETS_HPP

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "exchange/target_program.hpp"
#include "files/data_file.hpp"
#include "kinematics/compensated_targets.hpp"

namespace flexcomp::host {

struct ProgramTargets {
  Pose<double> f0;  ///< F0 seen from the frame in which the program's poses are
  std::optional<std::array<double, joint_count>> start_rad;  ///< where the program begins
  std::function<void(std::size_t, std::size_t)> progress;
};

/// A pose is taken on the branch that the program names; where several remain, on the one nearest to the command before.
/// \throws InputError  unreachable_pose, several_branches
TargetsFile joint_targets(const TargetProgram& program, const Robot& robot, const ProgramTargets& how);

/// The program's text. A corrected pose is the one that brings the nominal kinematics to the corrected joints.
std::string corrected_text(const TargetProgram& program, const Robot& robot, const Pose<double>& f0,
                           const std::vector<Answer>& answers);

}  // namespace flexcomp::host

#endif
