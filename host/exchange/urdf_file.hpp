// SPDX-License-Identifier: Apache-2.0
/// \file
/// Robot descriptions of ROS (URDF): the six turning joints between two links, as the file states them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "flexcomp/linear.hpp"
#include "flexcomp/robot.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

struct UrdfJoint {
  std::string name;
  Pose<double>
      origin;  ///< from the previous joint's frame (the base for the first), fixed joints between folded in
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();  ///< in this joint's own frame, norm 1
  JointLimits limits;                               ///< +-360 degrees where the file sets none
  double max_speed_rad_s = 0;                       ///< 0 where unknown
};

/// One joint of the way from the base to the tip, as the file has it.
struct UrdfStep {
  std::string joint;
  bool turning = false;
  Pose<double> origin;
};

struct UrdfArm {
  std::string name;  ///< of the <robot>
  std::string base;
  std::string flange;
  std::string tip;
  std::array<UrdfJoint, joint_count> joints;
  Pose<double> flange_after;  ///< from the sixth joint's frame
  Pose<double> tip_after;
  Pose<double> start;            ///< from the base to the parent of the first step; 1 where that is the base
  std::vector<UrdfStep> steps;   ///< all joints from there to the tip
  std::size_t flange_steps = 0;  ///< so many of them follow the sixth joint up to the flange
  Eigen::Vector3d down = -Eigen::Vector3d::UnitZ();  ///< -z of the root link, in the base
  std::vector<std::string> warnings;
};

/// Which links; empty ones are worked out.
struct UrdfLinks {
  std::string
      base;         ///< default: the root link. May hang on the arm's base by fixed joints (REP 199's `base`)
  std::string tip;  ///< default: the only link without children that is six turning joints away
  std::string
      flange;  ///< on the way to the tip; default: the link tool0 (REP 199), with any prefix, where there is one
};

/// Looks only at links, joints and what joints on the way to the tip are like.
/// \throws InputError  file absent; as parse_xml(); no URDF; links that do not exist or are not connected as they
///                     should be; other than six revolute or continuous joints between them; a joint of another kind, one
///                     that mimics, or one without axis or range. The joint or link is the field.
UrdfArm load_urdf(const std::string& path, const UrdfLinks& links);

}  // namespace flexcomp::host
