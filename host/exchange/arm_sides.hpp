// SPDX-License-Identifier: Apache-2.0
/// \file
/// On which side of its singularities an arm stands: what tells apart the ways to one pose of an arm with a wrist.
#pragma once

#include <array>
#include <optional>

#include "model/robot.hpp"

namespace flexcomp::host {

/// The three distances from the singularities, each positive as with all readings 0 (but for the wrist).
struct ArmSides {
  double axis_1_m = 0;     ///< of the wrist centre in front of axis 1
  double lower_arm_m = 0;  ///< of the wrist centre in front of the line from axis 2 to axis 3
  double axis_5_rad = 0;   ///< the reading
};

/// Nothing for an arm whose last three axes do not meet in a point (within 0.01 mm), or whose wrist centre is on neither side
/// (within 0.01 mm) when all readings are 0.
std::optional<ArmSides> arm_sides(const NominalRobot<joint_count>& robot,
                                  const std::array<double, joint_count>& q_rad);

/// Whether the arm stands as ABB's cfx says, 0 … 7 (RAPID reference manual, robconf): 4 for a wrist centre behind axis 1, 2 for
/// one behind the lower arm, 1 for a negative axis 5, added up. At an edge (1e-6 m, 1e-6 rad) both sides fit.
bool fits_cfx(const ArmSides& sides, int cfx);

}  // namespace flexcomp::host
