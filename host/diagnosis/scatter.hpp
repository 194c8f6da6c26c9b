// SPDX-License-Identifier: Apache-2.0
/// \file
/// Variance components of places (D15): places that move from pose to pose and follow nothing that was recorded, as play
/// without its direction, joints that were read too early, a loose screw. The alternative to a lack of fit.
#pragma once

#include <vector>

#include "diagnosis/effect_search.hpp"

namespace flexcomp::host {

/// Repeats the search under the noise of places that scatter, and replaces the selection where that one costs less.
/// Numbers of a row are not independent under such noise, and effects judged as if they were take chance for structure.
/// \param places  shares of the misfit at the start
/// \return whether the selection was replaced
bool prefer_scatter(Selection& selection, const Robot& robot, const std::vector<Observation>& rows,
                    const FittedModel& start, const ContextColumns& columns,
                    const std::vector<PlaceShare>& places, const DiagnosisProgress& progress);

}  // namespace flexcomp::host
