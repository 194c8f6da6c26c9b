// SPDX-License-Identifier: Apache-2.0
#include "identification/statistics.hpp"

#include <algorithm>
#include <cmath>

#include "distributions.hpp"

namespace flexcomp::host {

ErrorStatistics statistics(const std::vector<RowResidual>& errors, const std::vector<Observation>& rows) {
  ErrorStatistics s;
  double squares = 0;
  double angle_sum = 0;
  double angle_squares = 0;
  std::size_t oriented = 0;
  for (std::size_t k = 0; k < errors.size(); ++k) {
    const double e = errors[k].position_m.norm();
    s.mean_m += e;
    squares += e * e;
    s.max_m = std::max(s.max_m, e);
    if (!rows[k].has_orientation) continue;
    const double angle = errors[k].orientation_rad.norm();
    angle_sum += angle;
    angle_squares += angle * angle;
    ++oriented;
  }
  const double n = static_cast<double>(std::max<std::size_t>(errors.size(), 1));
  s.mean_m /= n;
  s.rms_m = std::sqrt(squares / n);
  if (oriented > 0) {
    s.mean_rad = angle_sum / static_cast<double>(oriented);
    s.rms_rad = std::sqrt(angle_squares / static_cast<double>(oriented));
  }
  return s;
}

double chi_square(const std::vector<RowResidual>& errors, const std::vector<Observation>& rows) {
  double sum = 0;
  for (std::size_t k = 0; k < errors.size(); ++k) sum += whitened(rows[k], errors[k]).squaredNorm();
  return sum;
}

double measured_numbers(const std::vector<Observation>& rows) {
  double n = 0;
  for (const Observation& row : rows) n += measured_numbers(row);
  return n;
}

bool chi_square_is_usual(double chi2, double degrees_of_freedom) {
  return degrees_of_freedom >= 1 && chi2 >= chi2_quantile(0.0005, degrees_of_freedom) &&
         chi2 <= chi2_quantile(0.9995, degrees_of_freedom);
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double chi2_of(const std::vector<RowResidual>& residuals, const std::vector<Observation>& rows,
               const std::vector<bool>& counts) {
  double chi2 = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (counts[k]) chi2 += whitened(rows[k], residuals[k]).squaredNorm();
  }
  return chi2;
}

}  // namespace flexcomp::host
