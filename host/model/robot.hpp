// SPDX-License-Identifier: Apache-2.0
/// \file
/// Robot: nominal geometry, limits, tool, payload, instrument noise and bodies of one arm.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
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
  std::string serial;                         ///< of the unit; empty where it is not known
  NominalRobot<joint_count> nominal;          ///< with name_hash of `name` and unit_hash of `serial`
  std::vector<Eigen::Vector3d> reflectors_m;  ///< A, B, C(, D) in Ftool; empty where the file has none
  bool has_noise = false;              ///< false: the two figures below are this program's, not the file's
  double position_sigma_m = 0.035e-3;  ///< standard deviation per axis of a measured point
  double orientation_sigma_rad = 0.007 * 3.14159265358979323846 / 180;  ///< per axis of the rotation vector
  std::array<double, joint_count> max_speed_rad_s{};                    ///< 0 where unknown
  std::array<double, joint_count> gear_ratio{};  ///< motor turns per joint turn, 0 where unknown
  std::vector<Capsule> capsules;
};

/// Longest serial number of a unit, bytes of UTF-8: what a controller can tell (flexcomp/wire/unit_record.hpp).
constexpr std::size_t longest_serial = 44;

/// Whether a text may be a serial number: 1 … longest_serial bytes of UTF-8 without control characters.
bool is_serial(std::string_view text);

/// Names the unit that a robot is; its sets are then bound to it.
void set_serial(Robot& robot, const std::string& serial);

/// The unit for messages: `unit 'A-4711'`; by its hash where only that is known.
std::string unit_text(const std::string& serial, const Sha256Digest& unit_hash);

}  // namespace flexcomp::host
