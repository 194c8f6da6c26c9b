// SPDX-License-Identifier: Apache-2.0
/// \file
/// Poses at which two names for one misfit predict different measurements.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_DISCRIMINATING_POSES_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_DISCRIMINATING_POSES_HPP

#include <cstdint>
#include <vector>

#include "diagnosis/effect_search.hpp"

namespace flexcomp::host {

/// T-optimal (Atkinson and Fedorov 1975): each pose is the one where the chosen name's prediction is missed by most by
/// the best fit of its rival to what was measured and to the poses before. As many as it takes until each rival would
/// miss by twice telling_bic, at most 20; empty where nothing is confounded.
std::vector<SuggestedPose> discriminating_poses(const Robot& robot, const std::vector<Observation>& rows,
                                                const Estimate& start, const Unknowns& fitted,
                                                const CandidateSet& candidates, const Explanation& found,
                                                const std::vector<FoundEffect>& effects, std::uint64_t seed);

}  // namespace flexcomp::host

#endif
