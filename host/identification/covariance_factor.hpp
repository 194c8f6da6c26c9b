// SPDX-License-Identifier: Apache-2.0
/// \file
/// Covariance of a fit as a calibration stores it: exact for few parameters, of low rank for curves of many coefficients.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "identification/estimator.hpp"
#include "identification/residuals.hpp"
#include "measurement/observation.hpp"
#include "model/calibration.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// Up to so many parameters the factor is that of Cholesky.
constexpr Eigen::Index exact_parameters = 150;
/// Beyond, a factor of low rank has at most so many numbers in the columns that only coefficients of curves have: 120
/// columns for six curves of 128 coefficients, which a file of 500 kB holds.
constexpr Eigen::Index curve_numbers = Eigen::Index{120} * 6 * 128;

/// Factor of the covariance (M40) of a fit: Cholesky's, or with partial pivoting over the coefficients of curves (M53), SI.
/// \param rows  that were fitted: the pose that is predicted near them must keep its uncertainty
CovarianceFactor covariance_factor(const Fit& fit, const Unknowns& fitted, const Robot& robot,
                                   const std::vector<Observation>& rows);

}  // namespace flexcomp::host
