/// \file
/// Poses for a study as each method of planning would choose them, all in the same cell.
#ifndef FLEXCOMP_HOST_STUDIES_PLANNED_HPP
#define FLEXCOMP_HOST_STUDIES_PLANNED_HPP

#include <cstddef>
#include <cstdint>
#include <vector>

#include "studies/calibrations.hpp"

namespace flexcomp::host {

enum class Planning {
  random,  ///< feasible, nothing else
  detmax,  ///< D-optimal exchange, the paper's baseline
  sapso,  ///< the paper's swarm; Omin from the true parameters and one draw of noise, as its Eq. 30 needs them
  ours    ///< the default of `plan`
};

/// `count` poses within limits, clear of the arm's bodies, and seen by a tracker that stands 2.5 m before the arm. Several
/// payloads: the plan chooses one of them for each pose.
std::vector<StudiedPose> planned_poses(const StudiedArm& arm, std::size_t count, Planning how,
                                       std::uint64_t seed, const std::vector<double>& payloads_kg = {});

}  // namespace flexcomp::host

#endif
