// SPDX-License-Identifier: Apache-2.0
/// \file
/// Converts a fit to a calibration.
#pragma once

#include <vector>

#include "identification/estimator.hpp"
#include "identification/residuals.hpp"
#include "measurement/observation.hpp"
#include "model/calibration.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// Builds the calibration of a fit: terms with standard deviations, frames where fitted, covariance factor, bounds, and
/// the robot's name and hash. Terms that were neither fitted nor given (coefficient zero) are left out.
/// \param rows  that were fitted
Calibration fitted_calibration(const Fit& fit, const Unknowns& fitted, const Robot& robot,
                               const std::vector<Observation>& rows);

/// The terms and frames of a calibration, as a fit starts from.
Estimate estimate_of(const Calibration& calibration);

}  // namespace flexcomp::host
