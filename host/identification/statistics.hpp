// SPDX-License-Identifier: Apache-2.0
/// \file
/// Error statistics of many rows, and chi-square.
#ifndef FLEXCOMP_HOST_IDENTIFICATION_STATISTICS_HPP
#define FLEXCOMP_HOST_IDENTIFICATION_STATISTICS_HPP

#include <optional>
#include <vector>

#include "identification/residuals.hpp"

namespace flexcomp::host {

/// Of the 3-D position error and, where orientations were measured, of the rotation angle.
struct ErrorStatistics {
  double mean_m = 0;
  double rms_m = 0;
  double max_m = 0;
  std::optional<double> mean_rad;
  std::optional<double> rms_rad;
};

ErrorStatistics statistics(const std::vector<RowResidual>& errors, const std::vector<Observation>& rows);

/// Sum of squared whitened residuals.
double chi_square(const std::vector<RowResidual>& errors, const std::vector<Observation>& rows);

/// Numbers measured: 6 per pose, 3 per position.
double measured_numbers(const std::vector<Observation>& rows);

/// Whether chi-square lies inside its two-sided 99.9 % interval.
bool chi_square_is_usual(double chi2, double degrees_of_freedom);

}  // namespace flexcomp::host

#endif
