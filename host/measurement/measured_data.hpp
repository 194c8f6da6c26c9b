// SPDX-License-Identifier: Apache-2.0
/// \file
/// Measured data: joint readings, measurement and context of each row.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "flexcomp/robot.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

enum class MeasurementKind { joints, position, pose, reflectors };  ///< joints: nothing measured

/// One row; positions and orientations are in the measurement frame (of F, or any frame of the instrument).
struct Measurement {
  std::size_t line = 0;
  std::array<double, joint_count> q_rad{};  ///< joint readings
  Context<double, joint_count> context;     ///< with the defaults of the robot file where a column is absent
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< norm 1, w >= 0
  /// Reflector points A, B, C(, D).
  std::array<Eigen::Vector3d, 4> reflector_m{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                                             Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  std::array<double, joint_count> move_rad{};  ///< last motion of each joint, 0 where unknown
  double position_sigma_m = 0;                 ///< per axis of the position, or of each reflector point
  double orientation_sigma_rad = 0;            ///< per axis of the rotation vector
  std::vector<std::string> extra;              ///< cells of the columns that have no meaning here
};

/// Which optional columns a file has (or shall get).
struct ContextColumns {
  bool payload_mass = false;
  std::array<bool, 3> payload_com{};
  std::array<bool, joint_count> move{};
  std::array<bool, joint_count> direction{};
  bool temperature = false;
  bool time = false;
  bool position_sigma = false;
  bool orientation_sigma = false;
  std::array<bool, 3> force{};

  /// Relative speeds are known.
  bool all_moves() const {
    return std::all_of(move.begin(), move.end(), [](bool b) { return b; });
  }
};

/// Rows of one file.
struct MeasuredData {
  std::string path;
  MeasurementKind kind = MeasurementKind::joints;
  std::size_t reflectors = 0;  ///< 3 or 4 where kind is reflectors
  std::vector<Measurement> rows;
  ContextColumns columns;
  std::vector<std::string> extra;     ///< names of columns without meaning here, passed through
  std::vector<std::string> warnings;  ///< complete sentences with file and column
};

}  // namespace flexcomp::host
