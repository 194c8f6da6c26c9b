/// \file
/// The cell file: where the tracker stands, what stands in the way, and how much room to leave.
#ifndef FLEXCOMP_HOST_FILES_CELL_FILE_HPP
#define FLEXCOMP_HOST_FILES_CELL_FILE_HPP

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "files/capsule.hpp"
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

/// Reads and checks a cell file.
/// \throws InputError  file absent or no YAML; a key that is unknown (with the nearest known one), given twice or of the
///                     wrong kind; an obstacle without ends or radius, or on a frame that moves; safety below 0;
///                     acceptance_deg not above 0 and at most 180
Cell load_cell(const std::string& path);

}  // namespace flexcomp::host

#endif
