// SPDX-License-Identifier: Apache-2.0
/// \file
/// Modified Levenberg-Marquardt on the nonlinear model (Chen et al. 2019, Section 4), whitened and robust.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "distributions.hpp"
#include "identification/residuals.hpp"
#include "interval.hpp"

namespace flexcomp::host {

struct EstimatorOptions {
  double upsilon = 10;  ///< step length coefficient of the damping; 4 … 100 all work (the paper)
  int largest_iterations = 200;
  bool robust = true;  ///< false: every row has weight 1
  /// False: without Fit::singular_values (the most expensive part where unknowns are many).
  bool spectrum = true;
  /// Called after each accepted step with the iteration and the cost; may be empty.
  std::function<void(int, double)> progress = {};
};

/// Result of fit().
struct Fit {
  Estimate estimate;
  bool converged = false;  ///< the exact gradient vanishes, see newton_decrement
  int iterations = 0;      ///< accepted steps
  /// Newton decrement: decrease of chi-square that a full Gauss-Newton step within the bounds predicts; converged
  /// below 1e-8.
  double newton_decrement = 0;
  double chi2 = 0;  ///< sum of squared whitened residuals of the rows with weight 1
  double degrees_of_freedom = 0;
  /// Robust scale (standard deviation) of the whitened residuals; 1 where the model explains the data.
  double scale = 1;
  std::vector<double> weight;  ///< per row: 1, less for down-weighted outliers
  /// Covariance of the unknowns in units_of(), prior included, bounds left out; from the declared noise, or from the
  /// residuals where chi-square says that the noise alone does not explain them.
  Eigen::MatrixXd covariance;
  std::vector<bool> at_bound;  ///< per parameter: the estimate is at its lower bound
  /// 95 % interval per parameter, Eq. (M41): of the normal distribution around the unbounded estimate, truncated at the
  /// bound; one-sided, from the bound up, where the estimate is at it.
  std::vector<Interval> interval;
  /// Singular values of the whitened, scaled derivative of the parameters (frames projected out).
  Eigen::VectorXd singular_values;

  /// Per row: whether its weight is 1 (docs/model.md, M39). All of `rows` where nothing was fitted.
  std::vector<bool> has_full_weight(std::size_t rows) const;
  /// Rows that are down-weighted, by index.
  std::vector<std::size_t> outliers() const;

  double chi2_per_dof() const { return degrees_of_freedom > 0 ? chi2 / degrees_of_freedom : 0; }
};

/// Fits `unknowns` by robust weighted least squares, starting at `start`. The derivative (with the priors as
/// further rows) must have full column rank: eliminate() first.
///
/// Minimises (M34) by modified Levenberg-Marquardt, (M35) to (M39). Robust loss: a row has weight 1 up to the 99.9 %
/// quantile of its chi-square at the robust scale, beyond it weight (quantile / square). Every step keeps the bounds
/// (active set); convergence is tested on the bounded problem.
Fit fit(const Estimate& start, const Unknowns& unknowns, const std::vector<Observation>& rows,
        const Robot& robot, const EstimatorOptions& options = {});

}  // namespace flexcomp::host
