// SPDX-License-Identifier: Apache-2.0
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
  random,          ///< feasible, nothing else
  detmax,          ///< D-optimal exchange, the paper's baseline
  sapso,           ///< the paper's swarm; Omin from the true parameters and one draw of noise (Eq. 30)
  sapso_expected,  ///< the same swarm with the expectation of Omin over all noise
  ours             ///< the default of `plan`
};

/// `count` poses within limits, clear of the arm's bodies, and seen by a tracker that stands 2.5 m before the arm. Several
/// payloads: the plan chooses one of them for each pose.
std::vector<StudiedPose> planned_poses(const StudiedArm& arm, std::size_t count, Planning how,
                                       std::uint64_t seed, const std::vector<double>& payloads_kg = {});

/// The criterion of planning, expected Omin / O1 (Eq. 33; smaller is better), at poses with the arm's own payload.
double criterion_of(const StudiedArm& arm, const std::vector<StudiedPose>& poses);

/// What the least squares estimate is off by at poses of Planning::sapso for the very draw of noise (N1) that they were
/// chosen with, SI, in the order of `parameters`.
Eigen::VectorXd errors_at_the_chosen_draw(const StudiedArm& arm, const std::vector<StudiedPose>& poses,
                                          std::uint64_t seed, const std::vector<Parameter>& parameters);

}  // namespace flexcomp::host

#endif
