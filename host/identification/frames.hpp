// SPDX-License-Identifier: Apache-2.0
/// \file
/// Estimates the measurement frames F (robot base in the instrument's frame) and E (measured point in Ftool), Eq. (M2).
#ifndef FLEXCOMP_HOST_IDENTIFICATION_FRAMES_HPP
#define FLEXCOMP_HOST_IDENTIFICATION_FRAMES_HPP

#include <vector>

#include "identification/estimator.hpp"
#include "identification/residuals.hpp"

namespace flexcomp::host {

enum class FrameChoice { by_distance, nominal, fit };

/// Estimates F and E for given terms (none: the nominal arm): closed-form start, then robust refinement.
Estimate fit_frames(const TermSet& set, const std::vector<Observation>& rows, const Robot& robot);

/// True where the nominal frames (F = E = 1) miss the median row by more than 20 mm or 2 degrees.
bool nominal_frames_are_off(const std::vector<RowResidual>& nominal, const std::vector<Observation>& rows);

}  // namespace flexcomp::host

#endif
