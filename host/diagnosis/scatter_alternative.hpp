// SPDX-License-Identifier: Apache-2.0
/// \file
/// Scatter of places as the alternative to a lack of fit: the selection under either noise that is likelier (D15).
#ifndef FLEXCOMP_HOST_DIAGNOSIS_SCATTER_ALTERNATIVE_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_SCATTER_ALTERNATIVE_HPP

#include <vector>

#include "diagnosis/search_and_refit.hpp"

namespace flexcomp::host {

/// Repeats the search under the noise of places that scatter, and replaces the selection where that one costs less.
/// Numbers of a row are not independent under such noise, and effects judged as if they were take chance for structure.
/// \param places  shares of the misfit at the start
/// \return whether the selection was replaced
bool prefer_scatter(Selection& selection, const Robot& robot, const std::vector<Observation>& rows,
                    const FittedModel& start, const ContextColumns& columns,
                    const std::vector<PlaceShare>& places, const DiagnosisProgress& progress);

}  // namespace flexcomp::host

#endif
