// SPDX-License-Identifier: Apache-2.0
/// \file
/// Pure error of repeated poses (instrument and repeatability of the arm), and the lack-of-fit test against it.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "interval.hpp"
#include "measurement/observation.hpp"

namespace flexcomp::host {

/// Pure error, Eq. (M27), pooled over all groups of repeats, each about its own mean.
struct PureError {
  std::size_t groups = 0;
  std::size_t rows = 0;              ///< in these groups
  double sigma_position_m = 0;       ///< standard deviation per axis
  Interval position_interval_m;      ///< of sigma_position_m
  double sigma_orientation_rad = 0;  ///< per axis of the rotation vector; 0 where no orientation was measured
  Interval orientation_interval_rad;  ///< of sigma_orientation_rad
  /// Of [position, m; rotation vector, rad] in the measurement frame.
  Matrix6d covariance = Matrix6d::Zero();
  double dof = 0;  ///< numbers measured in the groups, less one mean for each group
  /// Variance of the scatter in units of the declared noise; 1 is as declared.
  double chi2_per_dof_whitened = 0;
  /// Lack of fit, Eq. (M28), where the fit leaves degrees of freedom beyond those of the repeats: F, and the
  /// probability that a complete model has a larger one.
  std::optional<double> lack_of_fit_f;
  std::optional<double> lack_of_fit_p;
};

/// Groups of repeated rows: joint readings within 1e-9 rad and the same context, time and temperature included
/// (drift is no pure error). Indices, in groups of two or more, in the order of the rows.
std::vector<std::vector<std::size_t>> repeats(const std::vector<Observation>& rows);

/// Computes the pure error of rows, Eq. (M27), and the lack of fit, Eq. (M28). Nothing where no row is repeated.
/// \param fit_chi2, fit_dof  sum of squared whitened residuals and degrees of freedom of a least-squares fit of
///                           these rows, without down-weighted ones
std::optional<PureError> pure_error(const std::vector<Observation>& rows, double fit_chi2, double fit_dof);

}  // namespace flexcomp::host
