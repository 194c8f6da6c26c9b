// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/scatter.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/gap_system.hpp"
#include "identification/residuals.hpp"

namespace flexcomp::host {

namespace {

constexpr std::size_t most_places = 6;

/// A place must gain as much as a name.
constexpr double margin = least_gain;

Eigen::Index at(std::size_t row) { return 6 * static_cast<Eigen::Index>(row); }

/// 2 ln of the likelihood ratio of a place that scatters by sigma: of each row the information on the place and the
/// residual carried to it (Woodbury).
double gain_of(double sigma, const std::vector<double>& square, const std::vector<double>& product) {
  double gain = 0;
  for (std::size_t k = 0; k < square.size(); ++k) {
    const double wider = 1 + sigma * sigma * square[k];
    gain += sigma * sigma * product[k] * product[k] / wider - std::log(wider);
  }
  return gain;
}

Scatter best_scatter(Place place, const Eigen::VectorXd& column, const Eigen::VectorXd& residual,
                     const std::vector<bool>& speaks) {
  std::vector<double> square;
  std::vector<double> product;
  double information = 0;
  for (std::size_t k = 0; k < speaks.size(); ++k) {
    if (!speaks[k]) continue;
    const auto u = column.segment<6>(at(k));
    square.push_back(u.squaredNorm());
    product.push_back(u.dot(residual.segment<6>(at(k))));
    information += square.back();
  }
  Scatter best{place, 0, 0};
  if (!(information > 0)) return best;
  const double unit = std::sqrt(static_cast<double>(square.size()) / information);  // what one row can tell
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

double bonus(Place place) { return place.slot == slot::theta ? telling_bic : 0; }

/// Takes the noise of one place out of all rows of some columns: by (I + sigma^2 u u^T)^(-1/2).
class Narrowing {
 public:
  Narrowing(const Eigen::VectorXd& column, double sigma) : column_(column), sigma_(sigma) {}

  Eigen::Matrix<double, 6, 6> matrix(std::size_t row) const {
    const Vector6<double> u = column_.segment<6>(at(row));
    const double square = u.squaredNorm();
    Eigen::Matrix<double, 6, 6> m = Eigen::Matrix<double, 6, 6>::Identity();
    if (square > 0) m += (1 / std::sqrt(1 + sigma_ * sigma_ * square) - 1) / square * u * u.transpose();
    return m;
  }

  void apply(Eigen::VectorXd& to) const {
    for (std::size_t k = 0; at(k) < to.size(); ++k) {
      const Vector6<double> v = matrix(k) * to.segment<6>(at(k));
      to.segment<6>(at(k)) = v;
    }
  }

 private:
  Eigen::VectorXd column_;
  double sigma_;
};

}  // namespace

ScatteredModel scattered_model(const Robot& robot, const std::vector<Observation>& rows,
                               const Estimate& start, const Unknowns& fitted,
                               const std::vector<double>& weight) {
  ScatteredModel out;
  Estimate estimate = start;
  std::vector<double> weights = weight;
  for (int round = 0; round < 3; ++round) {
    const GapSystem system = gap_system(robot, rows, std::vector<bool>(rows.size(), true), estimate, fitted,
                                        CandidateSet{estimate.set, {}, {}, {}});
    Eigen::VectorXd residual(6 * static_cast<Eigen::Index>(rows.size()));
    const auto model = prepare(estimate.set, robot, "diagnosis");
    const std::vector<RowResidual> r = residuals(estimate, *model, rows);
    std::vector<bool> speaks(rows.size(), true);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      residual.segment<6>(at(k)) = whitened(rows[k], r[k]);
      if (k < weights.size() && weights[k] < 1) speaks[k] = false;
    }
    std::vector<PlaceColumn> places = system.places;
    out.places.clear();
    out.rows = rows;
    out.log_determinant = 0;
    while (out.places.size() < most_places) {
      Scatter best;
      const PlaceColumn* which = nullptr;
      for (const PlaceColumn& p : places) {
        const Scatter s = best_scatter(p.place, p.column, residual, speaks);
        // Where the rows do not tell them apart it is a joint: joints are what moves.
        if (!(s.gain > 0) ||
            !(s.gain + bonus(p.place) > best.gain + (which == nullptr ? 0 : bonus(which->place))))
          continue;
        best = s;
        which = &p;
      }
      if (which == nullptr || !(best.gain > std::log(system.numbers) + margin)) break;
      const Narrowing narrow(which->column, best.sigma);
      for (std::size_t k = 0; k < rows.size(); ++k) {
        out.log_determinant +=
            std::log1p(best.sigma * best.sigma * which->column.segment<6>(at(k)).squaredNorm());
        out.rows[k].whitening = narrow.matrix(k) * out.rows[k].whitening;
      }
      narrow.apply(residual);
      for (PlaceColumn& p : places) {
        if (&p != which) narrow.apply(p.column);
      }
      const Place place = which->place;
      places.erase(std::remove_if(places.begin(), places.end(),
                                  [&](const PlaceColumn& p) { return p.place == place; }),
                   places.end());
      out.places.push_back(best);
    }
    if (out.places.empty()) return out;
    EstimatorOptions options;
    options.spectrum = false;
    out.fit = fit(estimate, fitted, out.rows, robot, options);
    estimate = out.fit.estimate;
    weights = out.fit.weight;
  }
  return out;
}

}  // namespace flexcomp::host
