// SPDX-License-Identifier: Apache-2.0
/// \file
/// Targets of compensation.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "flexcomp/robot.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// A target of compensation: joint command or tool pose.
struct Target {
  std::size_t line = 0;
  std::array<double, joint_count> q_rad{};  ///< command; for a pose, the seed that chooses the branch
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();             ///< Ftool in F0, for poses
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< Ftool to F0, for poses
  Context<double, joint_count> context;
  std::vector<std::string> extra;
};

/// What a file of answers has beside its joints and the columns of its targets.
inline constexpr std::array<const char*, 3> answer_columns{"residual_mm", "residual_deg", "status"};

struct TargetsFile {
  std::string path;
  bool poses = false;  ///< false: joint commands
  std::vector<Target> rows;
  std::vector<std::string> extra;
  std::vector<std::string> warnings;
};

}  // namespace flexcomp::host
