// SPDX-License-Identifier: Apache-2.0
/// \file
/// Cell: where the tracker stands, the obstacles, and the clearance to keep.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "model/robot.hpp"
#include "units.hpp"

namespace flexcomp::host {

/// Everything is optional; the defaults are those of Chen et al. 2019, Section 3.2.
struct Cell {
  std::string path;                          ///< as it was given, for messages
  std::optional<Eigen::Vector3d> tracker_m;  ///< in Fb; absent: no beam to keep free
  /// Fixed in F0. Fb differs from it by B, which is at most 20 mm and 2 degrees and not known before the calibration: the
  /// safety factor covers it.
  std::vector<Capsule> obstacles;
  double safety = 3;  ///< s of Eq. 26: a reflector or a beam stays s * smr_radius_m away from every surface
  double smr_radius_m = 0.01905;  ///< r_s: of a 1.5-inch spherically mounted reflector
  /// Largest angle between the incoming beam and the reflectors' -N, rad; pi/2 is the half space of Eq. 28.
  double acceptance_rad = pi / 2;
};

}  // namespace flexcomp::host
