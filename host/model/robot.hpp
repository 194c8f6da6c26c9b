// SPDX-License-Identifier: Apache-2.0
/// \file
/// Robot: nominal geometry, limits, tool, payload, instrument noise and bodies of one arm.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "flexcomp/robot.hpp"

namespace flexcomp::host {

constexpr std::size_t joint_count = 6;

/// A body for collision and beam: all points within radius_m of a segment (of a point, where both ends are the same).
struct Capsule {
  std::size_t frame = 0;  ///< 0: F0; i: the frame after link i
  Eigen::Vector3d from_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_m = Eigen::Vector3d::Zero();
  double radius_m = 0;
};

struct Robot {
  std::string path;  ///< as it was given, for messages
  std::string name;
  NominalRobot<joint_count> nominal;          ///< with name_hash of `name`
  std::vector<Eigen::Vector3d> reflectors_m;  ///< A, B, C(, D) in Ftool; empty where the file has none
  bool has_noise = false;              ///< false: the two figures below are this program's, not the file's
  double position_sigma_m = 0.035e-3;  ///< standard deviation per axis of a measured point
  double orientation_sigma_rad = 0.007 * 3.14159265358979323846 / 180;  ///< per axis of the rotation vector
  std::array<double, joint_count> max_speed_rad_s{};                    ///< 0 where unknown
  std::array<double, joint_count> gear_ratio{};  ///< motor turns per joint turn, 0 where unknown
  std::vector<Capsule> capsules;
};

}  // namespace flexcomp::host
