// SPDX-License-Identifier: Apache-2.0
#include "identification/estimator.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>

#include "distributions.hpp"
#include "identification/statistics.hpp"
#include "linalg/blas.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {

namespace {

/// Squared norm of the whitened residual of each row.
Eigen::VectorXd squares(const Eigen::VectorXd& residual) {
  Eigen::VectorXd s(residual.size() / 6);
  for (Eigen::Index k = 0; k < s.size(); ++k) s[k] = residual.segment<6>(6 * k).squaredNorm();
  return s;
}

struct RobustWeights {
  double scale = 1;            // standard deviation of the whitened residual in the bulk
  std::vector<double> weight;  // of the squared residual, per row
};

/// Robust weights of the rows, Eq. (M39): scale from the median of their chi-squares, which a third of outliers
/// does not change; weight 1 up to the 99.9 % quantile, quantile / square beyond.
/// \param fitted  numbers that the fit takes up
RobustWeights robust_weights(const Eigen::VectorXd& square, const std::vector<Observation>& rows,
                             double fitted) {
  std::vector<double> ratio(rows.size());
  double measured = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    ratio[k] = square[static_cast<Eigen::Index>(k)] / chi2_quantile(0.5, measured_numbers(rows[k]));
    measured += measured_numbers(rows[k]);
  }
  RobustWeights out;
  // Fitted parameters take up part of the residual.
  const double share = std::max(0.05, (measured - fitted) / measured);
  out.scale = std::sqrt(std::max(median(ratio) / share, 1e-12));
  out.weight.resize(rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double limit =
        chi2_quantile(0.999, measured_numbers(rows[k])) * std::max(out.scale * out.scale, 1.0);
    const double s = square[static_cast<Eigen::Index>(k)];
    out.weight[k] = s > limit ? limit / s : 1.0;
  }
  return out;
}

/// Quadratic model of the objective around an estimate, dx in units_of(); its minimum solves normal * dx =
/// gradient, Eq. (M35).
struct Quadratic {
  Eigen::MatrixXd normal;
  Eigen::VectorXd gradient;
  Eigen::VectorXd least;  ///< lower bound of dx, minus infinity where there is none

  /// Decrease of chi-square by a step in the quadratic model.
  double gain(const Eigen::VectorXd& dx) const {
    return 2 * gradient.dot(dx) - dx.dot(normal.selfadjointView<Eigen::Lower>() * dx);
  }
};

/// Inverse of a positive semidefinite matrix of which the lower triangle is given; by BLAS where it can be.
Eigen::MatrixXd inverse_of_symmetric(const Eigen::MatrixXd& a) {
  Eigen::MatrixXd factor = a;
  return factor_in_place(factor) ? inverse_of_factored(factor) : Ldlt(a).inverse();
}

/// Solution of a x = b, a as before.
Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) {
  Eigen::MatrixXd factor = a;
  if (!factor_in_place(factor)) return Ldlt(a).solve(b);
  Eigen::MatrixXd x = b;
  solve_lower(factor, x);
  solve_lower_transposed(factor, x);
  return x;
}

/// Minimum of the damped quadratic within the bounds by an active set, Eq. (M37). Few parameters are bounded,
/// so it ends after a few rounds; the limit of 100 guards against cycling by rounding.
Eigen::VectorXd bounded_step(const Quadratic& q, double mu) {
  const Eigen::Index n = q.gradient.size();
  Eigen::MatrixXd damped = q.normal;
  damped.diagonal().array() += mu;
  Eigen::VectorXd dx = solve_symmetric(damped, q.gradient);
  if ((dx.array() >= q.least.array()).all()) return dx;
  std::vector<bool> active(static_cast<std::size_t>(n), false);
  damped = damped.selfadjointView<Eigen::Lower>();
  for (int round = 0; round < 100; ++round) {
    bool unchanged = true;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (active[static_cast<std::size_t>(i)] || dx[i] >= q.least[i]) continue;
      active[static_cast<std::size_t>(i)] = true;
      unchanged = false;
    }
    if (unchanged) {
      // Release the bound with the largest multiplier of the wrong sign.
      Eigen::Index release = n;
      double worst = 0;
      for (Eigen::Index i = 0; i < n; ++i) {
        if (!active[static_cast<std::size_t>(i)]) continue;
        const double multiplier = (q.gradient[i] - damped.row(i).dot(dx)) / std::sqrt(damped(i, i));
        if (multiplier > worst + 1e-12) {
          worst = multiplier;
          release = i;
        }
      }
      if (release == n) break;
      active[static_cast<std::size_t>(release)] = false;
    }
    Eigen::MatrixXd reduced = damped;
    Eigen::VectorXd right = q.gradient;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!active[static_cast<std::size_t>(i)]) continue;
      right -= damped.col(i) * q.least[i];
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!active[static_cast<std::size_t>(i)]) continue;
      reduced.row(i).setZero();
      reduced.col(i).setZero();
      reduced(i, i) = 1;
      right[i] = q.least[i];
    }
    dx = solve_symmetric(reduced, right);
  }
  return dx.cwiseMax(q.least);
}

/// An estimate with its residuals, their derivative and their squares per row.
struct Point {
  Estimate estimate;
  Linearised lin;
  Eigen::VectorXd square;
};

/// Objective of the fit: robust weighted least squares with priors, Eq. (M34).
class Objective {
  struct Group {
    Eigen::Index first;
    Eigen::MatrixXd precision;  // in units
    Eigen::VectorXd of(const Eigen::VectorXd& v) const { return v.segment(first, precision.rows()); }
  };

 public:
  Objective(const Unknowns& unknowns, const std::vector<Observation>& rows, const Robot& robot,
            const TermSet& set)
      : unknowns_(unknowns), rows_(rows), robot_(robot), units_(units_of(unknowns, set)) {
    const Eigen::Index n = static_cast<Eigen::Index>(unknowns.count());
    precision_ = expected_ = Eigen::VectorXd::Zero(n);
    least_ = Eigen::VectorXd::Constant(n, -std::numeric_limits<double>::infinity());
    const Eigen::Index frames = static_cast<Eigen::Index>(unknowns.frames.size());
    for (std::size_t p = 0; p < unknowns.parameters.size(); ++p) {
      const PriorKnowledge prior = unknowns.prior_of(p);
      const Eigen::Index i = frames + static_cast<Eigen::Index>(p);
      least_[i] = prior.least / units_[i];
      expected_[i] = prior.expected / units_[i];
      if (std::isfinite(prior.tolerance)) precision_[i] = std::pow(units_[i] / prior.tolerance, 2);
    }
    for (const GroupPrior& group : unknowns.groups) {
      const Eigen::Index size = group.precision.rows();
      const auto unit = units_.segment(frames + static_cast<Eigen::Index>(group.first), size);
      groups_.push_back({frames + static_cast<Eigen::Index>(group.first),
                         unit.asDiagonal() * group.precision * unit.asDiagonal()});
    }
  }

  Point at(Estimate estimate) const {
    Point point;
    const auto model = prepare(estimate.set, robot_, "identification");
    point.lin = linearised(estimate, *model, rows_, unknowns_);
    point.square = squares(point.lin.residual);
    point.estimate = std::move(estimate);
    return point;
  }

  double cost(const Point& point, const std::vector<double>& weight) const {
    const Eigen::VectorXd value = values(point.estimate);
    double sum = (value - expected_).cwiseAbs2().dot(precision_);
    for (const Group& g : groups_) sum += g.of(value).dot(g.precision * g.of(value));
    for (std::size_t k = 0; k < rows_.size(); ++k)
      sum += weight[k] * point.square[static_cast<Eigen::Index>(k)];
    return sum;
  }

  Quadratic quadratic(const Point& point, const std::vector<double>& weight) const {
    const Eigen::Index n = static_cast<Eigen::Index>(unknowns_.count());
    Quadratic q{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n), least_ - values(point.estimate)};
    // Row by row over its non-zero columns: a pose depends on four coefficients of a curve.
    std::vector<Eigen::Index> columns;
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      const auto block = point.lin.derivative.middleRows<6>(6 * static_cast<Eigen::Index>(k));
      columns.clear();
      for (Eigen::Index c = 0; c < n; ++c) {
        if ((block.col(c).array() != 0).any()) columns.push_back(c);
      }
      const Vector6<double> residual =
          weight[k] * point.lin.residual.segment<6>(6 * static_cast<Eigen::Index>(k));
      for (std::size_t i = 0; i < columns.size(); ++i) {
        const Vector6<double> column = block.col(columns[i]);
        q.gradient[columns[i]] += column.dot(residual);
        for (std::size_t j = 0; j <= i; ++j)
          q.normal(columns[i], columns[j]) += weight[k] * column.dot(block.col(columns[j]));
      }
    }
    const Eigen::VectorXd value = values(point.estimate);
    q.normal.diagonal() += precision_;
    q.gradient += precision_.cwiseProduct(expected_ - value);
    for (const Group& g : groups_) {
      const Eigen::Index size = g.precision.rows();
      q.normal.block(g.first, g.first, size, size) += g.precision;
      q.gradient.segment(g.first, size) -= g.precision * g.of(value);
    }
    return q;
  }

  /// Measured numbers that the fit takes up: the unknowns less tr(normal^-1 * prior precision), which priors decide.
  double fitted_numbers(const Eigen::MatrixXd& normal) const {
    double sum = static_cast<double>(unknowns_.count());
    if (groups_.empty() && precision_.isZero(0)) return sum;
    const Eigen::MatrixXd covariance = inverse_of_symmetric(normal);
    sum -= covariance.diagonal().dot(precision_);
    for (const Group& g : groups_) {
      const Eigen::Index size = g.precision.rows();
      sum -= covariance.block(g.first, g.first, size, size).cwiseProduct(g.precision).sum();
    }
    return sum;
  }

  Point moved(const Point& from, const Eigen::VectorXd& dx) const {
    Estimate estimate = from.estimate;
    move(estimate, unknowns_, dx);
    // A value that the step put on a bound lies on it exactly.
    for (std::size_t p = 0; p < unknowns_.parameters.size(); ++p) {
      const double least = unknowns_.prior_of(p).least;
      if (unknowns_.parameters[p].get(estimate.set) < least) unknowns_.parameters[p].set(estimate.set, least);
    }
    return at(std::move(estimate));
  }

  bool on_bound(const Estimate& estimate, std::size_t parameter) const {
    const double least = unknowns_.prior_of(parameter).least;
    const Eigen::Index i = static_cast<Eigen::Index>(unknowns_.frames.size() + parameter);
    return unknowns_.parameters[parameter].get(estimate.set) - least < 1e-9 * units_[i];
  }

  RobustWeights weights(const Point& point, const Quadratic& quadratic) const {
    return robust_weights(point.square, rows_, fitted_numbers(quadratic.normal));
  }

  std::size_t rows() const { return rows_.size(); }
  double unit(Eigen::Index i) const { return units_[i]; }

 private:
  /// Parameter values in units_of(); zero for the frames, which have no prior.
  Eigen::VectorXd values(const Estimate& estimate) const {
    Eigen::VectorXd v = Eigen::VectorXd::Zero(units_.size());
    const Eigen::Index frames = static_cast<Eigen::Index>(unknowns_.frames.size());
    for (std::size_t p = 0; p < unknowns_.parameters.size(); ++p) {
      const Eigen::Index i = frames + static_cast<Eigen::Index>(p);
      v[i] = unknowns_.parameters[p].get(estimate.set) / units_[i];
    }
    return v;
  }

  const Unknowns& unknowns_;
  const std::vector<Observation>& rows_;
  const Robot& robot_;
  Eigen::VectorXd units_;
  std::vector<Group> groups_;
  Eigen::VectorXd precision_;  // of the priors
  Eigen::VectorXd expected_;
  Eigen::VectorXd least_;
};

/// 95 % interval of a normal distribution truncated at `least`, Eq. (M41): equal tails, or from `least` up.
Interval allowed_interval(double mean, double sigma, double least, bool from_the_bound) {
  if (!(sigma > 0)) return {mean, mean};
  // Probability above the bound, by upper tails: a mean far below the bound leaves 1e-20.
  const double allowed = normal_above((least - mean) / sigma);
  const auto with_above = [&](double tail) {
    const double p = std::max(allowed * tail, 1e-300);
    return std::max(least, mean + sigma * normal_upper_quantile(p));
  };
  if (from_the_bound) return {least, with_above(0.05)};
  return {with_above(0.975), with_above(0.025)};
}

/// Schur complement of the normal matrix without the frames: information of the parameters alone, Eq. (M45).
Eigen::MatrixXd without_frames(const Eigen::MatrixXd& normal, Eigen::Index frames) {
  const Eigen::Index parameters = normal.cols() - frames;
  if (frames == 0) return normal;
  return normal.bottomRightCorner(parameters, parameters) -
         normal.bottomLeftCorner(parameters, frames) *
             Ldlt(normal.topLeftCorner(frames, frames))
                 .solve(Eigen::MatrixXd(normal.topRightCorner(frames, parameters)));
}

/// Result of the iteration: the estimate, the weights, and the quadratic model around it.
struct Minimum {
  Point point;
  RobustWeights robust;
  Quadratic quadratic;
};

/// Minimises the objective by modified Levenberg-Marquardt with re-weighting, Eq. (M35) to (M39).
Minimum minimise(const Objective& objective, const Estimate& start, const EstimatorOptions& options,
                 Fit& out) {
  Minimum m;
  m.point = objective.at(start);
  m.robust.weight.assign(objective.rows(), 1.0);
  m.quadratic = objective.quadratic(m.point, m.robust.weight);
  // Re-weights until the weights are stationary; a step between two sets of weights is no test of convergence.
  const auto weights_changed = [&]() {
    if (!options.robust) return false;
    RobustWeights fresh = objective.weights(m.point, m.quadratic);
    double change = 0;
    for (std::size_t k = 0; k < fresh.weight.size(); ++k)
      change = std::max(change, std::abs(fresh.weight[k] - m.robust.weight[k]));
    m.robust = std::move(fresh);
    if (change > 0) m.quadratic = objective.quadratic(m.point, m.robust.weight);
    return change > 1e-6;
  };

  // The nominal start is close and the model linear to 1e-3: nearly no damping is needed.
  double mu = 1e-7 * m.quadratic.normal.diagonal().mean();
  for (int trial = 0; trial < options.largest_iterations; ++trial) {
    // Convergence is judged by the decrement of the undamped step, Eq. (M38).
    const Eigen::VectorXd newton = bounded_step(m.quadratic, 0);
    out.newton_decrement = m.quadratic.gain(newton);
    const double bulk = std::max(1.0, m.robust.scale * m.robust.scale);
    // Near the minimum the residuals are noise and show which rows are outliers.
    if (out.newton_decrement < 10 * bulk && weights_changed()) continue;
    if (out.newton_decrement < 1e-9 * bulk) break;
    Point next = objective.moved(m.point, bounded_step(m.quadratic, mu));
    const double cost = objective.cost(m.point, m.robust.weight);
    const double next_cost = objective.cost(next, m.robust.weight);
    if (next_cost < cost) {
      // Eq. (M36): Chen 37 with its cases exchanged. Success lowers the damping, also by the ratio of the norms.
      mu = mu / options.upsilon * std::sqrt(next_cost / cost);
      m.point = std::move(next);
      ++out.iterations;
      if (options.progress) options.progress(out.iterations, next_cost);
      m.quadratic = objective.quadratic(m.point, m.robust.weight);
      if (cost - next_cost < 1e-13 * cost) break;
    } else {
      if (next_cost <= cost * (1 + 1e-13)) break;  // at the rounding of the cost; the decrement decides
      mu = std::max(mu, 1e-12 * m.quadratic.normal.diagonal().mean()) * options.upsilon;
      if (mu > 1e30) break;
    }
  }
  out.newton_decrement = m.quadratic.gain(bounded_step(m.quadratic, 0));
  return m;
}

/// Covariance, Eq. (M40), intervals, Eq. (M41), and singular values of a fit.
void add_uncertainty(const Objective& objective, const Quadratic& quadratic, const Unknowns& unknowns,
                     bool spectrum, Fit& out) {
  const Eigen::Index columns = static_cast<Eigen::Index>(unknowns.count());
  const Eigen::Index frames = static_cast<Eigen::Index>(unknowns.frames.size());
  const Eigen::MatrixXd normal = quadratic.normal.selfadjointView<Eigen::Lower>();
  out.covariance = inverse_of_symmetric(normal);
  if (out.degrees_of_freedom >= 1 && out.chi2 > chi2_quantile(0.9995, out.degrees_of_freedom)) {
    // The declared noise does not explain the residuals: their own variance scales the covariance.
    out.covariance *= out.chi2 / out.degrees_of_freedom;
  }
  const Eigen::VectorXd to_unbounded = solve_symmetric(normal, quadratic.gradient);
  for (std::size_t p = 0; p < unknowns.parameters.size(); ++p) {
    const Eigen::Index i = frames + static_cast<Eigen::Index>(p);
    const double value = unknowns.parameters[p].get(out.estimate.set);
    const double unbounded = value + to_unbounded[i] * objective.unit(i);
    const double sigma = std::sqrt(std::max(0.0, out.covariance(i, i))) * objective.unit(i);
    out.at_bound.push_back(objective.on_bound(out.estimate, p));
    out.interval.push_back(
        allowed_interval(unbounded, sigma, unknowns.prior_of(p).least, out.at_bound.back()));
  }
  if (spectrum && columns > frames) {
    out.singular_values =
        symmetric_eigen(without_frames(normal, frames)).values.cwiseMax(0).cwiseSqrt().reverse();
  }
}

}  // namespace

Fit fit(const Estimate& start, const Unknowns& unknowns, const std::vector<Observation>& rows,
        const Robot& robot, const EstimatorOptions& options) {
  Fit out;
  const Objective objective(unknowns, rows, robot, start.set);
  const Minimum m = minimise(objective, start, options, out);
  out.estimate = m.point.estimate;
  out.weight = m.robust.weight;
  out.scale = m.robust.scale;
  double measured = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (out.weight[k] < 1) continue;
    out.chi2 += m.point.square[static_cast<Eigen::Index>(k)];
    measured += measured_numbers(rows[k]);
  }
  out.degrees_of_freedom = measured - objective.fitted_numbers(m.quadratic.normal);
  // Re-weighting leaves a gradient of the size of rounding, in units of the bulk's chi-square.
  out.converged = std::isfinite(out.newton_decrement) &&
                  std::abs(out.newton_decrement) < 1e-8 * std::max(1.0, out.scale * out.scale);
  add_uncertainty(objective, m.quadratic, unknowns, options.spectrum, out);
  return out;
}

std::vector<bool> Fit::has_full_weight(std::size_t rows) const {
  std::vector<bool> out(rows, true);
  for (const std::size_t k : outliers()) out[k] = false;
  return out;
}

std::vector<std::size_t> Fit::outliers() const {
  std::vector<std::size_t> out;
  for (std::size_t k = 0; k < weight.size(); ++k) {
    if (weight[k] < 1) out.push_back(k);
  }
  return out;
}

}  // namespace flexcomp::host
