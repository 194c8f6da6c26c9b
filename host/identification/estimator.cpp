#include "identification/estimator.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>

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

}  // namespace

double chi2_quantile(double probability, double degrees_of_freedom) {
  return boost::math::quantile(boost::math::chi_squared(degrees_of_freedom), probability);
}

Fit fit(const Estimate& start, const Unknowns& unknowns, const std::vector<Observation>& rows,
        const RobotFile& robot, const EstimatorOptions& options) {
  Fit out;
  out.estimate = start;
  const Eigen::Index columns = static_cast<Eigen::Index>(unknowns.count());
  auto model = prepare(out.estimate.set, robot, "identification");
  Linearised lin = linearised(out.estimate, *model, rows, unknowns);
  Eigen::VectorXd square = squares(lin.residual);
  RobustWeights robust;
  robust.weight.assign(rows.size(), 1.0);

  const auto weighted_cost = [&](const Eigen::VectorXd& s) {
    double sum = 0;
    for (std::size_t k = 0; k < rows.size(); ++k) sum += robust.weight[k] * s[static_cast<Eigen::Index>(k)];
    return sum;
  };
  Eigen::MatrixXd normal(columns, columns);
  Eigen::VectorXd gradient(columns);
  const auto normal_equations = [&]() {
    Eigen::VectorXd weight(lin.residual.size());
    for (std::size_t k = 0; k < rows.size(); ++k) {
      weight.segment<6>(6 * static_cast<Eigen::Index>(k)).setConstant(robust.weight[k]);
    }
    const Eigen::MatrixXd weighted = weight.asDiagonal() * lin.derivative;
    normal.setZero();
    normal.selfadjointView<Eigen::Lower>().rankUpdate(
        Eigen::MatrixXd(weight.cwiseSqrt().asDiagonal() * lin.derivative).transpose());
    normal = normal.selfadjointView<Eigen::Lower>();
    gradient = weighted.transpose() * lin.residual;
  };

  double mu = 0;
  // Outer rounds: weights are held while the fit converges, then taken afresh until they settle.
  for (int round = 0; round < 30; ++round) {
    double cost = weighted_cost(square);
    normal_equations();
    if (mu == 0) mu = 1e-3 * normal.diagonal().mean();
    bool settled = false;
    for (int trial = 0; trial < options.largest_iterations && !settled; ++trial) {
      // What the undamped step would gain is the proof of convergence: the gradient in the metric of the problem.
      const Eigen::VectorXd newton = normal.ldlt().solve(gradient);
      out.newton_decrement = gradient.dot(newton);
      if (out.newton_decrement < 1e-9 * std::max(1.0, robust.scale * robust.scale)) {
        settled = true;
        break;
      }
      Eigen::MatrixXd damped = normal;
      damped.diagonal().array() += mu;
      const Eigen::VectorXd dx = damped.ldlt().solve(gradient);
      Estimate trial_estimate = out.estimate;
      move(trial_estimate, unknowns, dx);
      auto trial_model = prepare(trial_estimate.set, robot, "identification");
      Linearised trial_lin = linearised(trial_estimate, *trial_model, rows, unknowns);
      const Eigen::VectorXd trial_square = squares(trial_lin.residual);
      const double trial_cost = weighted_cost(trial_square);
      const double ratio = std::sqrt(trial_cost / cost);
      if (trial_cost < cost) {
        // Eq. 37 with its cases the right way round: success lowers the damping, by the ratio of the norms besides.
        mu = mu / options.upsilon * ratio;
        out.estimate = std::move(trial_estimate);
        lin = std::move(trial_lin);
        square = trial_square;
        ++out.iterations;
        if (options.progress) options.progress(out.iterations, trial_cost);
        const bool rounding = cost - trial_cost < 1e-13 * cost;
        cost = trial_cost;
        normal_equations();
        if (rounding) settled = true;
      } else if (trial_cost <= cost * (1 + 1e-13)) {
        settled = true;  // at the rounding of the cost itself; the decrement below judges
      } else {
        mu *= options.upsilon;
        if (mu > 1e30) break;
      }
    }
    if (!options.robust) break;
    const std::vector<double> before = robust.weight;
    robust = weigh(square, rows, unknowns.count());
    double change = 0;
    for (std::size_t k = 0; k < rows.size(); ++k)
      change = std::max(change, std::abs(robust.weight[k] - before[k]));
    if (change < 1e-6) break;
  }
  normal_equations();
  const Eigen::LDLT<Eigen::MatrixXd> factor(normal);
  out.newton_decrement = gradient.dot(factor.solve(gradient));

  out.weight = robust.weight;
  out.scale = robust.scale;
  double measured = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (out.weight[k] < 1) continue;
    out.chi2 += square[static_cast<Eigen::Index>(k)];
    measured += dimensions(rows[k]);
  }
  out.degrees_of_freedom = measured - static_cast<double>(unknowns.count());
  // Weights that still change between rounds leave a gradient of rounding size in chi-square units of the bulk.
  out.converged = std::isfinite(out.newton_decrement) &&
                  std::abs(out.newton_decrement) < 1e-8 * std::max(1.0, out.scale * out.scale);

  out.covariance = factor.solve(Eigen::MatrixXd::Identity(columns, columns));
  if (out.degrees_of_freedom >= 1 && out.chi2 > chi2_quantile(0.9995, out.degrees_of_freedom)) {
    // The noise that was declared does not explain the residuals: they themselves say how uncertain the result is.
    out.covariance *= out.chi2 / out.degrees_of_freedom;
  }
  const Eigen::Index frames = static_cast<Eigen::Index>(unknowns.frames.size());
  Eigen::MatrixXd parameters = lin.derivative.rightCols(columns - frames);
  if (frames > 0 && columns > frames) {
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(lin.derivative.leftCols(frames));
    const Eigen::MatrixXd q = qr.householderQ() * Eigen::MatrixXd::Identity(parameters.rows(), frames);
    parameters -= q * (q.transpose() * parameters);
  }
  if (parameters.cols() > 0) {
    out.singular_values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(parameters.transpose() * parameters)
                              .eigenvalues()
                              .cwiseMax(0)
                              .cwiseSqrt()
                              .reverse();
  }
  return out;
}

}  // namespace flexcomp::host
