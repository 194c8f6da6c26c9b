// SPDX-License-Identifier: Apache-2.0
/// \file
/// Quaternions of files (Hamilton, w x y z) and rotation vectors.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <string>

namespace flexcomp::host {

/// Normalised and with w >= 0; nothing where |norm - 1| > 1e-3. One that is already normal to rounding stays as it is,
/// bit by bit, so that files read back identically.
std::optional<Eigen::Quaterniond> unit_quaternion(const std::array<double, 4>& wxyz);
/// In words, for messages: what unit_quaternion() expects, and "norm 1.02".
constexpr const char* unit_quaternion_rule = "a quaternion of norm 1 (within 0.001)";
std::string norm_text(const std::array<double, 4>& wxyz);

/// Of a rotation matrix, norm 1, w >= 0.
Eigen::Quaterniond unit_quaternion(const Eigen::Matrix3d& rotation);

/// Rotation vector log(to fromᵀ), rad, in the outer frame.
Eigen::Vector3d rotation_between(const Eigen::Matrix3d& to, const Eigen::Matrix3d& from);

}  // namespace flexcomp::host
