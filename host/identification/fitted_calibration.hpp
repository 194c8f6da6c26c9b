/// \file
/// What a fit has found, as a calibration.
#ifndef FLEXCOMP_HOST_IDENTIFICATION_FITTED_CALIBRATION_HPP
#define FLEXCOMP_HOST_IDENTIFICATION_FITTED_CALIBRATION_HPP

#include "files/calibration_file.hpp"
#include "files/robot_file.hpp"
#include "identification/estimator.hpp"
#include "identification/residuals.hpp"

namespace flexcomp::host {

/// Terms, their uncertainty, frames (where `fitted` moves them), covariance, bounds; stamped. Terms that were neither
/// fitted nor given (coefficient zero) say nothing and are left out.
Calibration fitted_calibration(const Fit& fit, const Unknowns& fitted, const RobotFile& robot);

}  // namespace flexcomp::host

#endif
