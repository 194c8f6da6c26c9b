// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/scatter.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "diagnosis/gap_system.hpp"
#include "diagnosis/result.hpp"
#include "identification/residuals.hpp"

namespace flexcomp::host {

namespace {

constexpr std::size_t most_places = 6;

/// 2 ln of the likelihood ratio of a place that scatters by sigma (D15, by Woodbury's identity).
/// \param square, product  per row: |u|^2 and u . r
double gain_of(double sigma, const std::vector<double>& square, const std::vector<double>& product) {
  double gain = 0;
  for (std::size_t k = 0; k < square.size(); ++k) {
    const double wider = 1 + sigma * sigma * square[k];
    gain += sigma * sigma * product[k] * product[k] / wider - std::log(wider);
  }
  return gain;
}

Scatter best_scatter(Place place, const Eigen::VectorXd& column, const Eigen::VectorXd& residual,
                     const std::vector<bool>& has_full_weight) {
  std::vector<double> square;
  std::vector<double> product;
  double information = 0;
  for (std::size_t k = 0; k < has_full_weight.size(); ++k) {
    if (!has_full_weight[k]) continue;
    const auto u = column.segment<6>(first_number(k));
    square.push_back(u.squaredNorm());
    product.push_back(u.dot(residual.segment<6>(first_number(k))));
    information += square.back();
  }
  Scatter best{place, 0, 0};
  if (!(information > 0)) return best;
  const double unit =
      std::sqrt(static_cast<double>(square.size()) / information);  // standard deviation of one row
  // From a tenth to a thousand of that, refined twice.
  double low = std::log(0.1);
  double high = std::log(1000.0);
  for (int round = 0; round < 3; ++round) {
    constexpr int steps = 24;
    double here = low;
    for (int k = 0; k <= steps; ++k) {
      const double x = low + (high - low) * k / steps;
      const double sigma = unit * std::exp(x);
      const double gain = gain_of(sigma, square, product);
      if (gain <= best.gain) continue;
      best.gain = gain;
      best.sigma = sigma;
      here = x;
    }
    const double width = (high - low) / steps;
    if (best.sigma > 0 && round > 0) here = std::log(best.sigma / unit);
    low = here - width;
    high = here + width;
  }
  return best;
}

/// Where the rows do not separate places, the scatter is that of a joint: joints are what moves.
double bonus(Place place) { return place.slot == slot::theta ? decisive_bic : 0; }

/// Takes the noise of one place out of all rows of some columns: by (I + sigma^2 u u^T)^(-1/2).
class Narrowing {
 public:
  Narrowing(const Eigen::VectorXd& column, double sigma) : column_(column), sigma_(sigma) {}

  Eigen::Matrix<double, 6, 6> matrix(std::size_t row) const {
    const Vector6<double> u = column_.segment<6>(first_number(row));
    const double square = u.squaredNorm();
    Eigen::Matrix<double, 6, 6> m = Eigen::Matrix<double, 6, 6>::Identity();
    if (square > 0) m += (1 / std::sqrt(1 + sigma_ * sigma_ * square) - 1) / square * u * u.transpose();
    return m;
  }

  void apply(Eigen::VectorXd& to) const {
    for (std::size_t k = 0; first_number(k) < to.size(); ++k) {
      const Vector6<double> v = matrix(k) * to.segment<6>(first_number(k));
      to.segment<6>(first_number(k)) = v;
    }
  }

 private:
  Eigen::VectorXd column_;
  double sigma_;
};

/// Adds the scatter of the likeliest places to the noise of the rows, one after the other, while each gains enough.
/// \param residual  whitened, of the present model \param numbers  that were measured
void add_scatter(ScatteredModel& out, std::vector<PlaceColumn> places, Eigen::VectorXd residual,
                 const std::vector<bool>& has_full_weight, double numbers) {
  while (out.places.size() < most_places) {
    Scatter best;
    auto which = places.end();
    for (auto p = places.begin(); p != places.end(); ++p) {
      const Scatter s = best_scatter(p->place, p->column, residual, has_full_weight);
      if (!(s.gain > 0) ||
          !(s.gain + bonus(p->place) > best.gain + (which == places.end() ? 0 : bonus(which->place))))
        continue;
      best = s;
      which = p;
    }
    if (which == places.end() || !(best.gain > std::log(numbers) + least_gain)) return;
    const Narrowing narrow(which->column, best.sigma);
    for (std::size_t k = 0; k < out.rows.size(); ++k) {
      out.log_determinant +=
          std::log1p(best.sigma * best.sigma * which->column.segment<6>(first_number(k)).squaredNorm());
      out.rows[k].whitening = narrow.matrix(k) * out.rows[k].whitening;
    }
    places.erase(which);
    narrow.apply(residual);
    for (PlaceColumn& p : places) narrow.apply(p.column);
    out.places.push_back(best);
  }
}

}  // namespace

ScatteredModel scattered_model(const Robot& robot, const std::vector<Observation>& rows,
                               const FittedModel& start) {
  ScatteredModel out;
  out.fit = start.fit;
  for (int round = 0; round < 3; ++round) {
    const Estimate estimate = out.fit.estimate;
    const GapSystem system =
        gap_system(robot, rows, std::vector<bool>(rows.size(), true), estimate, start.fitted);
    out.places.clear();
    out.rows = rows;
    out.log_determinant = 0;
    add_scatter(out, system.places, whitened(residuals(estimate, robot, rows, "diagnosis"), rows),
                out.fit.has_full_weight(rows.size()), system.numbers);
    if (out.places.empty()) return out;
    EstimatorOptions options;
    options.spectrum = false;
    out.fit = fit(estimate, start.fitted, out.rows, robot, options);
  }
  return out;
}

}  // namespace flexcomp::host
