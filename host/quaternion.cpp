// SPDX-License-Identifier: Apache-2.0
#include "quaternion.hpp"

#include <fmt/format.h>

#include <cmath>

namespace flexcomp::host {

namespace {

/// w >= 0; where w is 0, the first component that is not 0 is positive.
Eigen::Quaterniond upper_half(Eigen::Quaterniond q) {
  double sign = 1;
  for (const double v : {q.w(), q.x(), q.y(), q.z()}) {
    if (v != 0) {
      sign = v;
      break;
    }
  }
  if (sign < 0) q.coeffs() = -q.coeffs();
  return q;
}

}  // namespace

std::optional<Eigen::Quaterniond> unit_quaternion(const std::array<double, 4>& wxyz) {
  Eigen::Quaterniond q(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  const double norm = q.norm();
  if (!(std::abs(norm - 1) <= 1e-3)) return {};
  if (std::abs(norm - 1) > 1e-15) q.coeffs() /= norm;
  return upper_half(q);
}

std::string norm_text(const std::array<double, 4>& wxyz) {
  // No overflow of squares, however far off the numbers are.
  return fmt::format("norm {:.6g}", std::hypot(std::hypot(wxyz[0], wxyz[1]), std::hypot(wxyz[2], wxyz[3])));
}

Eigen::Quaterniond unit_quaternion(const Eigen::Matrix3d& rotation) {
  return upper_half(Eigen::Quaterniond(rotation).normalized());
}

Eigen::Vector3d rotation_between(const Eigen::Matrix3d& to, const Eigen::Matrix3d& from) {
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(to * from.transpose()));
  return turn.angle() * turn.axis();
}

}  // namespace flexcomp::host
