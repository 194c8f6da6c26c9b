// SPDX-License-Identifier: Apache-2.0
/// \file
/// Inverse kinematics of the nominal arm.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "flexcomp/linear.hpp"
#include "model/robot.hpp"
#include "model/targets.hpp"

namespace flexcomp::host {

/// Solves the inverse kinematics by Newton's method from a seed, which selects the branch.
/// \param target  Ftool in F0
/// \return joint positions within the limits, which reach the pose to 1e-11 m and rad; nothing without convergence
std::optional<std::array<double, joint_count>> nominal_inverse(
    const NominalRobot<joint_count>& robot, const Pose<double>& target,
    const std::array<double, joint_count>& seed_rad);

/// All solutions of the inverse kinematics within the limits, those a full turn apart included: Newton's method
/// from 160 quasi-random seeds. At a singularity, with infinitely many solutions, some of them.
std::vector<std::array<double, joint_count>> nominal_inverses(const NominalRobot<joint_count>& robot,
                                                              const Pose<double>& target);

/// Joint command of every target. \throws InputError  with the line of a pose that is not reached from its seed
std::vector<std::array<double, joint_count>> joint_commands(const TargetsFile& targets, const Robot& robot);

}  // namespace flexcomp::host
