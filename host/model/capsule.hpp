// SPDX-License-Identifier: Apache-2.0
/// \file
/// A rigid body of simple shape: collision and beam tests of robot, tool and cell.
#ifndef FLEXCOMP_HOST_MODEL_CAPSULE_HPP
#define FLEXCOMP_HOST_MODEL_CAPSULE_HPP

#include <Eigen/Core>
#include <cstddef>

namespace flexcomp::host {

/// A body for collision and beam: all points within radius_m of a segment (of a point, where both ends are the same).
struct Capsule {
  std::size_t frame = 0;  ///< 0: F0; i: the frame after link i
  Eigen::Vector3d from_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_m = Eigen::Vector3d::Zero();
  double radius_m = 0;
};

}  // namespace flexcomp::host

#endif
