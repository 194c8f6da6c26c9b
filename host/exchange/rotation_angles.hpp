// SPDX-License-Identifier: Apache-2.0
/// \file
/// Rotations by three angles, in the conventions of instruments and robot makers.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace flexcomp::host {

/// What three angles rx, ry, rz mean. A file does not tell.
enum class AngleConvention {
  fixed_xyz,       ///< Rot(z,rz) Rot(y,ry) Rot(x,rx): about fixed axes x, y, z; SpatialAnalyzer, URDF
  moving_xyz,      ///< Rot(x,rx) Rot(y,ry) Rot(z,rz): about the axes as they move; Stäubli
  rotation_vector  ///< one turn about (rx, ry, rz) by its length; Universal Robots
};
Eigen::Quaterniond rotation(AngleConvention convention, const Eigen::Vector3d& angles_rad);

/// KUKA's A, B, C: Rot(z,a) Rot(y,b) Rot(x,c).
Eigen::Quaterniond kuka_rotation(const Eigen::Vector3d& abc_rad);

/// (roll, pitch, yaw) of Rot(z,yaw) Rot(y,pitch) Rot(x,roll), exact to rounding also where pitch is 90 degrees and only the
/// sum or difference of the others is defined.
Eigen::Vector3d roll_pitch_yaw(const Eigen::Matrix3d& rotation);

}  // namespace flexcomp::host
