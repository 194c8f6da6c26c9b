// SPDX-License-Identifier: Apache-2.0
/// \file
/// Where the measurement frame lies (F) and what point of the tool was measured (E): both of any size.
#ifndef FLEXCOMP_HOST_IDENTIFICATION_FRAMES_HPP
#define FLEXCOMP_HOST_IDENTIFICATION_FRAMES_HPP

#include <vector>

#include "identification/estimator.hpp"
#include "identification/residuals.hpp"

namespace flexcomp::host {

enum class FrameChoice { by_distance, nominal, fit };

/// Closed-form start and robust refinement of F and E for a given set of terms (none: the nominal arm).
Estimate fit_frames(const TermSet& set, const std::vector<Observation>& rows, const Robot& robot);

/// True where the nominal frames (F = E = 1) are off by more than 20 mm or 2 degrees in the median row.
bool nominal_frames_are_off(const std::vector<RowResidual>& nominal, const std::vector<Observation>& rows);

}  // namespace flexcomp::host

#endif
