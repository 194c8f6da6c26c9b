// SPDX-License-Identifier: Apache-2.0
/// \file
/// Joint commands of the nominal arm for poses of its tool.
#ifndef FLEXCOMP_HOST_KINEMATICS_NOMINAL_INVERSE_HPP
#define FLEXCOMP_HOST_KINEMATICS_NOMINAL_INVERSE_HPP

#include <array>
#include <optional>
#include <vector>

#include "flexcomp/linear.hpp"
#include "model/robot.hpp"
#include "model/targets.hpp"

namespace flexcomp::host {

/// Newton's method on the nominal chain from a seed, which chooses the branch. The result reaches the pose (Ftool in F0)
/// within 1e-11 m and rad and lies within the joint limits; nothing where there is none near the seed.
std::optional<std::array<double, joint_count>> nominal_inverse(
    const NominalRobot<joint_count>& robot, const Pose<double>& target,
    const std::array<double, joint_count>& seed_rad);

/// All joint commands within the limits that reach the pose, those a whole turn apart included: Newton's method from many
/// seeds, the same in every run. Along a singularity there are infinitely many; some of them are given.
std::vector<std::array<double, joint_count>> nominal_inverses(const NominalRobot<joint_count>& robot,
                                                              const Pose<double>& target);

/// The joint command of every target. \throws InputError with the line of a pose that is not reached from its seed
std::vector<std::array<double, joint_count>> joint_commands(const TargetsFile& targets, const Robot& robot);

}  // namespace flexcomp::host

#endif
