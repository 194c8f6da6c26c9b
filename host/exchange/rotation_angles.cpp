// SPDX-License-Identifier: Apache-2.0
#include "exchange/rotation_angles.hpp"

#include <array>
#include <cmath>

#include "quaternion.hpp"

namespace flexcomp::host {

Eigen::Quaterniond rotation(AngleConvention convention, const Eigen::Vector3d& angles_rad) {
  const Eigen::AngleAxisd x(angles_rad.x(), Eigen::Vector3d::UnitX());
  const Eigen::AngleAxisd y(angles_rad.y(), Eigen::Vector3d::UnitY());
  const Eigen::AngleAxisd z(angles_rad.z(), Eigen::Vector3d::UnitZ());
  Eigen::Quaterniond q;
  if (convention == AngleConvention::fixed_xyz) {
    q = z * y * x;
  } else if (convention == AngleConvention::moving_xyz) {
    q = x * y * z;
  } else {
    const double angle = angles_rad.norm();
    q = angle > 0 ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, angles_rad / angle))
                  : Eigen::Quaterniond::Identity();
  }
  return *unit_quaternion(std::array<double, 4>{q.w(), q.x(), q.y(), q.z()});
}

Eigen::Quaterniond kuka_rotation(const Eigen::Vector3d& abc_rad) {
  return rotation(AngleConvention::fixed_xyz, abc_rad.reverse());
}

Eigen::Vector3d roll_pitch_yaw(const Eigen::Matrix3d& r) {
  // Yaw first, and roll of what is left when yaw is undone: where pitch is 90 degrees yaw is arbitrary, and roll makes up
  // for whatever it is.
  const double yaw = std::atan2(r(1, 0), r(0, 0));
  const double s = std::sin(yaw);
  const double c = std::cos(yaw);
  const double pitch = std::atan2(-r(2, 0), c * r(0, 0) + s * r(1, 0));
  const double roll = std::atan2(s * r(0, 2) - c * r(1, 2), c * r(1, 1) - s * r(0, 1));
  return {roll, pitch, yaw};
}

}  // namespace flexcomp::host
