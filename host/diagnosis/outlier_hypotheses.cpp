// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/outlier_hypotheses.hpp"

#include <algorithm>
#include <cmath>

namespace flexcomp::host {

double cost_with_outliers(const Robot& robot, const std::vector<Observation>& rows, const Refit& refit,
                          const Scored& solution, double noise_scale2) {
  const Eigen::VectorXd e = whitened(residuals(refit.fit.estimate, robot, rows, "diagnosis"), rows);
  double sum = 0;
  for (std::size_t k = 0; k < rows.size(); ++k)
    sum += std::min(e.segment<6>(first_number(k)).squaredNorm() / noise_scale2, outlier_price);
  return sum + (solution.chi2_gain - solution.gain) +
         least_gain * static_cast<double>(solution.blocks.size());
}

std::vector<std::vector<bool>> outlier_alternatives(const Robot& robot, const std::vector<Observation>& rows,
                                                    const Refit& refit, const GapSystem& everything) {
  constexpr double unexplained = 30;  // chi-square of a row beside the joint's rotation
  std::vector<std::vector<bool>> alternatives;
  if (rows.size() <= many_rows) alternatives.emplace_back(rows.size(), true);
  const Eigen::VectorXd e = whitened(residuals(refit.fit.estimate, robot, rows, "diagnosis"), rows);
  const std::vector<std::size_t> outliers = refit.fit.outliers();
  std::vector<bool> aligned;
  std::size_t most = 0;
  for (std::uint8_t joint = 1; joint <= joint_count; ++joint) {
    const Eigen::VectorXd& u = place_column(everything, {joint, slot::theta});
    std::vector<bool> counts = refit.fit.has_full_weight(rows.size());
    std::size_t count = 0;
    for (const std::size_t k : outliers) {
      const Vector6<double> ek = e.segment<6>(first_number(k));
      const auto uk = u.segment<6>(first_number(k));
      const double along = uk.squaredNorm() > 0 ? ek.dot(uk) * ek.dot(uk) / uk.squaredNorm() : 0;
      if (ek.squaredNorm() - along > unexplained) continue;
      counts[k] = true;
      ++count;
    }
    if (count > most) {
      most = count;
      aligned = counts;
    }
  }
  if (!aligned.empty()) alternatives.push_back(aligned);
  return alternatives;
}

}  // namespace flexcomp::host
