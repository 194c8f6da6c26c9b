// SPDX-License-Identifier: Apache-2.0
/// \file
/// Poses at which confounded effects predict different measurements.
#pragma once

#include <cstdint>
#include <vector>

#include "diagnosis/candidates.hpp"
#include "diagnosis/refit.hpp"

namespace flexcomp::host {

/// T-optimal design (D18: Atkinson and Fedorov 1975): each pose is the one at which the best fit of the rival, to the rows
/// and the poses before, misses the chosen effect by most. As many as it takes until each rival would miss by twice
/// decisive_bic, at most 20; empty where nothing is confounded.
std::vector<SuggestedPose> discriminating_poses(const Robot& robot, const std::vector<Observation>& rows,
                                                const FittedModel& start, const CandidateSet& candidates,
                                                const std::vector<Hypothesis>& hypotheses,
                                                const std::vector<FoundEffect>& effects, std::uint64_t seed);

}  // namespace flexcomp::host
