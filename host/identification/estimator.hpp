// SPDX-License-Identifier: Apache-2.0
/// \file
/// Modified Levenberg-Marquardt on the nonlinear model (Chen et al. 2019, Section 4), whitened and robust.
#ifndef FLEXCOMP_HOST_IDENTIFICATION_ESTIMATOR_HPP
#define FLEXCOMP_HOST_IDENTIFICATION_ESTIMATOR_HPP

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "identification/residuals.hpp"
#include "interval.hpp"

namespace flexcomp::host {

struct EstimatorOptions {
  double upsilon = 10;  ///< step length coefficient of the damping; 4 … 100 all work (the paper)
  int largest_iterations = 200;
  bool robust = true;  ///< false: every row counts in full
  bool spectrum =
      true;  ///< false: Fit::singular_values are not wanted (they cost the most where unknowns are many)
  /// Called after each accepted step with the iteration and the cost; may be empty.
  std::function<void(int, double)> progress;
};

struct Fit {
  Estimate estimate;
  bool converged = false;  ///< the exact gradient vanishes, see newton_decrement
  int iterations = 0;      ///< accepted steps
  /// What a full Gauss-Newton step within the bounds would still gain, in units of chi-square: below 1e-8 is converged.
  double newton_decrement = 0;
  double chi2 = 0;  ///< sum of squared whitened residuals of the rows that count in full
  double degrees_of_freedom = 0;
  /// Standard deviation of the whitened residual as the bulk of the rows shows it; 1 where the model explains the data.
  double scale = 1;
  std::vector<double> weight;  ///< per row: 1 in full, less for outliers
  /// Covariance of the unknowns in units_of(), prior included, bounds left out; from the declared noise, or from the
  /// residuals where chi-square says that the noise alone does not explain them.
  Eigen::MatrixXd covariance;
  std::vector<bool> at_bound;  ///< per parameter: its estimate is the least that its prior allows
  /// 95 % interval per parameter. Of one that is bounded: the 95 % of the normal distribution around the unbounded
  /// estimate that physics allows; one-sided, from the bound up, where the estimate is at it.
  std::vector<Interval> interval;
  Eigen::VectorXd
      singular_values;  ///< of the whitened, scaled derivative of the parameters (frames projected out)

  /// Per row: whether it counts in full (docs/model.md, M39: weight 1). All of `rows` where nothing was fitted.
  std::vector<bool> in_full(std::size_t rows) const;
  /// Rows that are down-weighted, by index.
  std::vector<std::size_t> outliers() const;

  double chi2_per_dof() const { return degrees_of_freedom > 0 ? chi2 / degrees_of_freedom : 0; }
};

/// Fits `unknowns`, starting at `start`. The derivative (with the priors as further rows) must have full column rank:
/// eliminate() first.
///
/// Whitened throughout: metres and radians never meet unweighted. Robust loss: a row counts in full up to the 99.9 %
/// quantile of its chi-square around the scale of the bulk, beyond it with weight (quantile / square): gross outliers
/// lose their pull, and Gaussian data lose nothing. Bounds are kept by every step (active set), and the proof of
/// convergence is that of the bounded problem.
Fit fit(const Estimate& start, const Unknowns& unknowns, const std::vector<Observation>& rows,
        const Robot& robot, const EstimatorOptions& options = {});

/// Quantile of the chi-square distribution.
double chi2_quantile(double probability, double degrees_of_freedom);

}  // namespace flexcomp::host

#endif
