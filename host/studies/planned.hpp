// SPDX-License-Identifier: Apache-2.0
/// \file
/// Measurement poses of a study by each planning method, in one cell.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "studies/calibrations.hpp"

namespace flexcomp::host {

/// Planning method.
enum class Planning {
  random,          ///< random feasible poses
  detmax,          ///< D-optimal exchange, the paper's baseline
  sapso,           ///< the paper's swarm; Omin from the true parameters and one draw of noise (Eq. 30)
  sapso_expected,  ///< the same swarm with the expectation of Omin over all noise
  ours             ///< the default of `plan`
};

/// Plans `count` feasible poses (limits, collisions, visibility from a tracker 2.5 m in front of the arm). Of several
/// payloads the plan chooses one for each pose.
std::vector<StudiedPose> planned_poses(const StudiedArm& arm, std::size_t count, Planning how,
                                       std::uint64_t seed, const std::vector<double>& payloads_kg = {});

/// Planning criterion, expected Omin / O1 (M46), of poses with the arm's own payload.
double criterion_of(const StudiedArm& arm, const std::vector<StudiedPose>& poses);

/// Errors of the least squares estimate at poses of Planning::sapso with the draw of noise (N1) that they were
/// optimised for, SI, in the order of `parameters`.
Eigen::VectorXd errors_at_the_chosen_draw(const StudiedArm& arm, const std::vector<StudiedPose>& poses,
                                          std::uint64_t seed, const std::vector<Parameter>& parameters);

}  // namespace flexcomp::host
