// SPDX-License-Identifier: Apache-2.0
#include "exchange/arm_sides.hpp"

#include <Eigen/Core>
#include <cmath>
#include <cstddef>

#include "exchange/axis_chain.hpp"

namespace flexcomp::host {

namespace {

constexpr double meets_m = 1e-5;

/// From the axis, which is z of `frame`, to `point`, at a right angle to it.
Eigen::Vector3d from_axis(const Pose<double>& frame, const Eigen::Vector3d& point) {
  const Eigen::Vector3d z = frame.rotation.col(2);
  const Eigen::Vector3d away = point - frame.position;
  return away - z * z.dot(away);
}

struct Arm {
  Eigen::Vector3d lever;  ///< of the wrist centre, from axis 1, in a frame that turns with it
  double lower_arm_m;     ///< signed by the direction of axis 2
};

std::optional<Arm> arm(const NominalRobot<joint_count>& robot, const std::array<double, joint_count>& q_rad) {
  const auto f = link_frames(robot, q_rad);
  // Where axis 4 is nearest to axis 5.
  const Eigen::Vector3d a = f[3].rotation.col(2);
  const Eigen::Vector3d b = f[4].rotation.col(2);
  const Eigen::Vector3d apart = f[4].position - f[3].position;
  const double ab = a.dot(b);
  if (1 - ab * ab < 1e-6) return {};
  const Eigen::Vector3d wrist = f[3].position + a * ((a - ab * b).dot(apart) / (1 - ab * ab));
  for (const std::size_t axis : {4U, 5U}) {
    if (from_axis(f[axis], wrist).norm() > meets_m) return {};
  }
  const Eigen::Vector3d axis_2 = f[1].rotation.col(2);
  const Eigen::Vector3d lower_arm = from_axis(f[1], f[2].position);
  if (lower_arm.norm() < meets_m) return {};
  return Arm{f[1].rotation.transpose() * from_axis(f[0], wrist),
             -axis_2.dot(lower_arm.normalized().cross(from_axis(f[2], wrist)))};
}

}  // namespace

std::optional<ArmSides> arm_sides(const NominalRobot<joint_count>& robot,
                                  const std::array<double, joint_count>& q_rad) {
  const auto zero = arm(robot, {});
  const auto now = arm(robot, q_rad);
  if (!zero || !now || zero->lever.norm() < meets_m || std::abs(zero->lower_arm_m) < meets_m) return {};
  return ArmSides{now->lever.dot(zero->lever.normalized()),
                  std::copysign(1.0, zero->lower_arm_m) * now->lower_arm_m, q_rad[4]};
}

bool fits_cfx(const ArmSides& sides, int cfx) {
  constexpr double edge = 1e-6;
  const std::array<double, 3> from{sides.axis_5_rad, sides.lower_arm_m, sides.axis_1_m};
  for (std::size_t k = 0; k < from.size(); ++k) {
    if (std::abs(from[k]) > edge && (from[k] < 0) != ((cfx >> k & 1) != 0)) return false;
  }
  return true;
}

}  // namespace flexcomp::host
