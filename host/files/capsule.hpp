/// \file
/// A body of simple shape, as robot and cell files give it.
#ifndef FLEXCOMP_HOST_FILES_CAPSULE_HPP
#define FLEXCOMP_HOST_FILES_CAPSULE_HPP

#include <Eigen/Core>
#include <cstddef>

namespace flexcomp::host {

class YamlField;

/// A body for collision and beam: all points within radius_m of a segment (of a point, where both ends are the same).
struct Capsule {
  std::size_t frame = 0;  ///< 0: F0; i: the frame after link i
  Eigen::Vector3d from_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_m = Eigen::Vector3d::Zero();
  double radius_m = 0;
};

/// A body of the robot: frame, from_mm, to_mm, radius_mm. \throws InputError
Capsule read_capsule(const YamlField& field);

/// A body that stands still: the same keys, in F0; `frame` may be left out and is 0. \throws InputError
Capsule read_fixed_capsule(const YamlField& field);

}  // namespace flexcomp::host

#endif
