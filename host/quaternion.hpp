// SPDX-License-Identifier: Apache-2.0
/// \file
/// Quaternions of files (Hamilton, w x y z) and rotation vectors.
#ifndef FLEXCOMP_HOST_QUATERNION_HPP
#define FLEXCOMP_HOST_QUATERNION_HPP

#include <Eigen/Geometry>
#include <array>
#include <optional>

namespace flexcomp::host {

/// Normalised and with w >= 0; nothing where |norm - 1| > 1e-3. One that is already normal to rounding stays as it is,
/// bit by bit, so that files read back identically.
std::optional<Eigen::Quaterniond> unit_quaternion(const std::array<double, 4>& wxyz);

/// Of a rotation matrix, norm 1, w >= 0.
Eigen::Quaterniond unit_quaternion(const Eigen::Matrix3d& rotation);

/// Rotation vector log(to fromᵀ), rad, in the outer frame.
Eigen::Vector3d rotation_between(const Eigen::Matrix3d& to, const Eigen::Matrix3d& from);

}  // namespace flexcomp::host

#endif
