// SPDX-License-Identifier: Apache-2.0
#include "identification/estimator.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <memory>

namespace flexcomp::host {

namespace {

/// Squared whitened residual of each row.
Eigen::VectorXd squares(const Eigen::VectorXd& residual) {
  Eigen::VectorXd s(residual.size() / 6);
  for (Eigen::Index k = 0; k < s.size(); ++k) s[k] = residual.segment<6>(6 * k).squaredNorm();
  return s;
}

double dimensions(const Observation& row) { return row.has_orientation ? 6 : 3; }

double median(std::vector<double> v) {
  const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  std::nth_element(v.begin(), middle, v.end());
  return *middle;
}

struct RobustWeights {
  double scale = 1;            // standard deviation of the whitened residual in the bulk
  std::vector<double> weight;  // of the squared residual, per row
};

/// The scale from the median of the rows' chi-squares, so that a third of wild rows does not move it; then full weight
/// up to the 99.9 % quantile and quantile / square beyond.
RobustWeights weigh(const Eigen::VectorXd& square, const std::vector<Observation>& rows,
                    std::size_t unknowns) {
  std::vector<double> ratio(rows.size());
  double measured = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    ratio[k] = square[static_cast<Eigen::Index>(k)] / chi2_quantile(0.5, dimensions(rows[k]));
    measured += dimensions(rows[k]);
  }
  RobustWeights out;
  // Fitted parameters take up part of the residual.
  const double share = std::max(0.05, (measured - static_cast<double>(unknowns)) / measured);
  out.scale = std::sqrt(std::max(median(ratio) / share, 1e-12));
  out.weight.resize(rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double limit = chi2_quantile(0.999, dimensions(rows[k])) * std::max(out.scale * out.scale, 1.0);
    const double s = square[static_cast<Eigen::Index>(k)];
    out.weight[k] = s > limit ? limit / s : 1.0;
  }
  return out;
}

/// Linearised cost around an estimate, dx in units_of(): normal * dx = gradient at its minimum.
struct Quadratic {
  Eigen::MatrixXd normal;
  Eigen::VectorXd gradient;
  Eigen::VectorXd least;  ///< of dx; minus infinity where nothing bounds it

  /// What a step gains in chi-square, as far as the cost is quadratic.
  double gain(const Eigen::VectorXd& dx) const {
    return 2 * gradient.dot(dx) - dx.dot(normal.selfadjointView<Eigen::Lower>() * dx);
  }
};

/// Minimum within the bounds by an active set. Few parameters are bounded, so this ends after a few rounds; the limit is
/// there for rounding that keeps one on the edge.
Eigen::VectorXd bounded_step(const Quadratic& q, double mu) {
  const Eigen::Index n = q.gradient.size();
  Eigen::MatrixXd damped = q.normal;
  damped.diagonal().array() += mu;
  Eigen::VectorXd dx = damped.ldlt().solve(q.gradient);
  if ((dx.array() >= q.least.array()).all()) return dx;
  std::vector<bool> held(static_cast<std::size_t>(n), false);
  damped = damped.selfadjointView<Eigen::Lower>();
  for (int round = 0; round < 100; ++round) {
    bool settled = true;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (held[static_cast<std::size_t>(i)] || dx[i] >= q.least[i]) continue;
      held[static_cast<std::size_t>(i)] = true;
      settled = false;
    }
    if (settled) {
      // A bound that pushes into the allowed side holds nothing back: let the worst one go.
      Eigen::Index release = n;
      double worst = 0;
      for (Eigen::Index i = 0; i < n; ++i) {
        if (!held[static_cast<std::size_t>(i)]) continue;
        const double push = (q.gradient[i] - damped.row(i).dot(dx)) / std::sqrt(damped(i, i));
        if (push > worst + 1e-12) {
          worst = push;
          release = i;
        }
      }
      if (release == n) break;
      held[static_cast<std::size_t>(release)] = false;
    }
    Eigen::MatrixXd reduced = damped;
    Eigen::VectorXd right = q.gradient;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!held[static_cast<std::size_t>(i)]) continue;
      right -= damped.col(i) * q.least[i];
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!held[static_cast<std::size_t>(i)]) continue;
      reduced.row(i).setZero();
      reduced.col(i).setZero();
      reduced(i, i) = 1;
      right[i] = q.least[i];
    }
    dx = reduced.ldlt().solve(right);
  }
  return dx.cwiseMax(q.least);
}

/// One state of the descent: an estimate with its residuals, their derivative and their squares per row.
struct Point {
  Estimate estimate;
  Linearised lin;
  Eigen::VectorXd square;
};

class Descent {
 public:
  Descent(const Unknowns& unknowns, const std::vector<Observation>& rows, const Robot& robot,
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
    double sum = (values(point.estimate) - expected_).cwiseAbs2().dot(precision_);
    for (std::size_t k = 0; k < rows_.size(); ++k)
      sum += weight[k] * point.square[static_cast<Eigen::Index>(k)];
    return sum;
  }

  Quadratic quadratic(const Point& point, const std::vector<double>& weight) const {
    const Eigen::Index n = static_cast<Eigen::Index>(unknowns_.count());
    Quadratic q{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n), least_ - values(point.estimate)};
    // Row by row over the columns that it has: of a curve's coefficients a pose touches four.
    std::vector<Eigen::Index> touched;
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      const auto block = point.lin.derivative.middleRows<6>(6 * static_cast<Eigen::Index>(k));
      touched.clear();
      for (Eigen::Index c = 0; c < n; ++c) {
        if ((block.col(c).array() != 0).any()) touched.push_back(c);
      }
      const Vector6<double> residual =
          weight[k] * point.lin.residual.segment<6>(6 * static_cast<Eigen::Index>(k));
      for (std::size_t i = 0; i < touched.size(); ++i) {
        const Vector6<double> column = block.col(touched[i]);
        q.gradient[touched[i]] += column.dot(residual);
        for (std::size_t j = 0; j <= i; ++j)
          q.normal(touched[i], touched[j]) += weight[k] * column.dot(block.col(touched[j]));
      }
    }
    q.normal.diagonal() += precision_;
    q.gradient += precision_.cwiseProduct(expected_ - values(point.estimate));
    return q;
  }

  Point moved(const Point& from, const Eigen::VectorXd& dx) const {
    Estimate estimate = from.estimate;
    move(estimate, unknowns_, dx);
    // What the step put on a bound lies on it, not a rounding beside it.
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

  double unit(Eigen::Index i) const { return units_[i]; }

 private:
  /// In units; of the frames, which have no prior, zero.
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
  Eigen::VectorXd precision_;  // of the priors
  Eigen::VectorXd expected_;
  Eigen::VectorXd least_;
};

/// 95 % of a normal distribution above `least`: symmetric in probability, or from `least` up.
Interval allowed_interval(double mean, double sigma, double least, bool from_the_bound) {
  const boost::math::normal standard;
  if (!(sigma > 0)) return {mean, mean};
  // Share of the distribution that is allowed; upper tails, because a mean far below the bound leaves 1e-20 of it.
  const double allowed = boost::math::cdf(boost::math::complement(standard, (least - mean) / sigma));
  const auto with_above = [&](double tail) {
    const double p = std::max(allowed * tail, 1e-300);
    return std::max(least, mean + sigma * boost::math::quantile(boost::math::complement(standard, p)));
  };
  if (from_the_bound) return {least, with_above(0.05)};
  return {with_above(0.975), with_above(0.025)};
}

/// Schur complement of the frames: what the data know of the parameters whatever the frames are.
Eigen::MatrixXd without_frames(const Eigen::MatrixXd& normal, Eigen::Index frames) {
  const Eigen::Index parameters = normal.cols() - frames;
  if (frames == 0) return normal;
  return normal.bottomRightCorner(parameters, parameters) -
         normal.bottomLeftCorner(parameters, frames) *
             normal.topLeftCorner(frames, frames).ldlt().solve(normal.topRightCorner(frames, parameters));
}

}  // namespace

double chi2_quantile(double probability, double degrees_of_freedom) {
  return boost::math::quantile(boost::math::chi_squared(degrees_of_freedom), probability);
}

Fit fit(const Estimate& start, const Unknowns& unknowns, const std::vector<Observation>& rows,
        const Robot& robot, const EstimatorOptions& options) {
  Fit out;
  const Descent descent(unknowns, rows, robot, start.set);
  Point point = descent.at(start);
  RobustWeights robust;
  robust.weight.assign(rows.size(), 1.0);
  Quadratic quadratic = descent.quadratic(point, robust.weight);
  // From weights to weights until they settle; a step in which they changed proves nothing.
  const auto weigh_again = [&]() {
    if (!options.robust) return false;
    RobustWeights fresh = weigh(point.square, rows, unknowns.count());
    double change = 0;
    for (std::size_t k = 0; k < rows.size(); ++k)
      change = std::max(change, std::abs(fresh.weight[k] - robust.weight[k]));
    robust = std::move(fresh);
    if (change > 0) quadratic = descent.quadratic(point, robust.weight);
    return change > 1e-6;
  };

  // A start that is nearly right, as a drawing is, needs nearly no damping: the model is linear but for 1e-3.
  double mu = 1e-7 * quadratic.normal.diagonal().mean();
  for (int trial = 0; trial < options.largest_iterations; ++trial) {
    // What the undamped step would gain is the proof of convergence: the gradient in the metric of the problem.
    const Eigen::VectorXd newton = bounded_step(quadratic, 0);
    out.newton_decrement = quadratic.gain(newton);
    const double bulk = std::max(1.0, robust.scale * robust.scale);
    // Near the minimum the residuals are noise, and say which rows are not.
    if (out.newton_decrement < 10 * bulk && weigh_again()) continue;
    if (out.newton_decrement < 1e-9 * bulk) break;
    Point next = descent.moved(point, bounded_step(quadratic, mu));
    const double cost = descent.cost(point, robust.weight);
    const double next_cost = descent.cost(next, robust.weight);
    if (next_cost < cost) {
      // Eq. 37 with its cases the right way round: success lowers the damping, by the ratio of the norms besides.
      mu = mu / options.upsilon * std::sqrt(next_cost / cost);
      point = std::move(next);
      ++out.iterations;
      if (options.progress) options.progress(out.iterations, next_cost);
      quadratic = descent.quadratic(point, robust.weight);
      if (cost - next_cost < 1e-13 * cost) break;
    } else {
      if (next_cost <= cost * (1 + 1e-13)) break;  // at the rounding of the cost itself; the decrement judges
      mu = std::max(mu, 1e-12 * quadratic.normal.diagonal().mean()) * options.upsilon;
      if (mu > 1e30) break;
    }
  }
  out.newton_decrement = quadratic.gain(bounded_step(quadratic, 0));

  out.estimate = point.estimate;
  out.weight = robust.weight;
  out.scale = robust.scale;
  double measured = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (out.weight[k] < 1) continue;
    out.chi2 += point.square[static_cast<Eigen::Index>(k)];
    measured += dimensions(rows[k]);
  }
  out.degrees_of_freedom = measured - static_cast<double>(unknowns.count());
  // Weights that still change between rounds leave a gradient of rounding size in chi-square units of the bulk.
  out.converged = std::isfinite(out.newton_decrement) &&
                  std::abs(out.newton_decrement) < 1e-8 * std::max(1.0, out.scale * out.scale);

  const Eigen::Index columns = static_cast<Eigen::Index>(unknowns.count());
  const Eigen::Index frames = static_cast<Eigen::Index>(unknowns.frames.size());
  const Eigen::MatrixXd normal = quadratic.normal.selfadjointView<Eigen::Lower>();
  const Eigen::LDLT<Eigen::MatrixXd> factor(normal);
  out.covariance = factor.solve(Eigen::MatrixXd::Identity(columns, columns));
  if (out.degrees_of_freedom >= 1 && out.chi2 > chi2_quantile(0.9995, out.degrees_of_freedom)) {
    // The noise that was declared does not explain the residuals: they themselves say how uncertain the result is.
    out.covariance *= out.chi2 / out.degrees_of_freedom;
  }
  const Eigen::VectorXd to_unbounded = factor.solve(quadratic.gradient);
  for (std::size_t p = 0; p < unknowns.parameters.size(); ++p) {
    const Eigen::Index i = frames + static_cast<Eigen::Index>(p);
    const double value = unknowns.parameters[p].get(out.estimate.set);
    const double unbounded = value + to_unbounded[i] * descent.unit(i);
    const double sigma = std::sqrt(std::max(0.0, out.covariance(i, i))) * descent.unit(i);
    out.at_bound.push_back(descent.on_bound(out.estimate, p));
    out.interval.push_back(
        allowed_interval(unbounded, sigma, unknowns.prior_of(p).least, out.at_bound.back()));
  }
  if (options.spectrum && columns > frames) {
    out.singular_values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(without_frames(normal, frames))
                              .eigenvalues()
                              .cwiseMax(0)
                              .cwiseSqrt()
                              .reverse();
  }
  return out;
}

std::vector<bool> Fit::in_full(std::size_t rows) const {
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
