// SPDX-License-Identifier: Apache-2.0
/// \file
/// From the axes of six joints in space, however a drawing states them, to the links of Eq. 1 that move the same way.
#pragma once

#include <Eigen/Core>
#include <array>

#include "exchange/urdf_file.hpp"
#include "flexcomp/linear.hpp"
#include "flexcomp/robot.hpp"
#include "model/paper_model.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// Below this, lengths (m) and angles (rad) are rounding of the drawing's own numbers.
constexpr double rounding = 1e-12;

/// A directed line about which a joint turns by the right-hand rule.
struct AxisLine {
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< norm 1
};

/// An arm with all joint readings at zero, seen from one frame, its base.
struct AxisChain {
  std::array<AxisLine, joint_count> axes;
  Pose<double> flange;  ///< where a tool is mounted; guides the choice of F6 and nothing else
  Pose<double> tip;     ///< the frame whose motion is to be kept: Ftool
};

/// The same arm after Eq. 1: base_to_f0 · A1(q1) … A6(q6) · tool = the tip, for every q.
struct LinkChain {
  Pose<double> base_to_f0;  ///< F0 as seen from the base; constant
  bool f0_is_base = false;  ///< base_to_f0 is 1, exactly
  std::array<NominalLink, joint_count> links;
  std::array<double, 3> tool_xyz_m{{0, 0, 0}};
  std::array<double, 4> tool_wxyz{{1, 0, 0, 0}};
};

/// Any lines: crossing, intersecting, parallel, nearly parallel, antiparallel, the same.
///
/// Eq. 1 has five numbers for the four that a directed line has, so one is free. Where two successive axes are not
/// parallel (parallel_within_rad, as for what is identified), beta = 0 and the link is the drawing's of Denavit and Hartenberg; of its two
/// readings the one with |theta| <= 90 degrees. Else d = 0 and beta takes what is left of the direction (Hayati):
/// lengths stay of the size of the arm. F6 has its z axis along the flange's or across it but never against it
/// (alpha_6 = 180 degrees where the flange looks against axis 6), and is the flange itself where that is possible.
///
/// F0 is the base itself where the base's z axis is the axis of joint 1; else the nearest frame of which that is true:
/// the least rotation, the nearest point of the axis. (Where joint 1 turns about -z, F0 is upside down: Eq. 1 knows no
/// sign of a reading.)
///
/// Numbers are rounded to 1e-10 mm and 1e-10 degrees, which moves the tip of an arm by some 1e-12 m and makes 90 of
/// 89.99999999999999.
LinkChain links_of(const AxisChain& chain);

/// Rot(z,theta + q) Trans(z,d) Trans(x,a) Rot(x,alpha) Rot(y,beta).
Pose<double> link_pose(const NominalLink& link, double q_rad);

/// Frames 0 … 6 in F0.
std::array<Pose<double>, joint_count + 1> link_frames(const NominalRobot<joint_count>& robot,
                                                      const std::array<double, joint_count>& q_rad = {});

/// Ftool in F6.
Pose<double> tool_pose(const NominalRobot<joint_count>& robot);

/// The axes and frames of a description of ROS, seen from its base link.
AxisChain axes_of(const UrdfArm& arm);

/// The axes and frames of links, at readings of zero, seen from F0: the way back. The flange is F6.
AxisChain axes_of(const NominalRobot<joint_count>& robot);

}  // namespace flexcomp::host
