// SPDX-License-Identifier: Apache-2.0
/// \file
/// Error statistics of rows, chi-square, median.
#pragma once

#include <optional>
#include <vector>

#include "identification/residuals.hpp"

namespace flexcomp::host {

/// Mean, root mean square and maximum of the 3-D position error, m, and of the rotation angle, rad, where measured.
struct ErrorStatistics {
  double mean_m = 0;
  double rms_m = 0;
  double max_m = 0;
  std::optional<double> mean_rad;
  std::optional<double> rms_rad;
};

ErrorStatistics statistics(const std::vector<RowResidual>& errors, const std::vector<Observation>& rows);

/// Chi-square: sum of squared whitened residuals, of all rows given (M42, M51).
double chi_square(const std::vector<RowResidual>& errors, const std::vector<Observation>& rows);

/// Sum of the squared whitened residuals of the rows that count (M51).
double chi2_of(const std::vector<RowResidual>& residuals, const std::vector<Observation>& rows,
               const std::vector<bool>& counts);

/// Numbers measured by a row: 6 for a pose, 3 for a position.
inline double measured_numbers(const Observation& row) { return row.has_orientation ? 6 : 3; }
/// Sum over rows.
double measured_numbers(const std::vector<Observation>& rows);

/// True where chi-square lies inside its two-sided 99.9 % interval.
bool chi_square_is_usual(double chi2, double degrees_of_freedom);

/// Median, the upper one of an even count; 0 of none.
double median(std::vector<double> values);

}  // namespace flexcomp::host
