// SPDX-License-Identifier: Apache-2.0
// Unnamed functions that are concentrated near one pair of joint readings (D10).

#include <cmath>
#include <utility>

#include "diagnosis/smooth_functions.hpp"
#include "diagnosis/spline.hpp"

namespace flexcomp::host {

namespace {

/// Rows that a spline touches, and its value there.
using Touched = std::vector<std::pair<Eigen::Index, double>>;

Touched touched_by(const Eigen::VectorXd& x, double centre, double spacing) {
  Touched out;
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const double value = 1.5 * cardinal_spline(angle_difference(x[k], centre) / spacing);
    if (value > 0) out.emplace_back(k, value);
  }
  return out;
}

/// Gain of a bump of a joint (D10); nothing where it is not above `least`.
/// \param y  value of the second spline at every row
std::optional<double> gain_above(double least, const PlaceProjection& s, const Touched& x,
                                 const Eigen::VectorXd& y, double noise_scale2, double log_n) {
  double b = 0;
  double square = 0;
  std::size_t touched = 0;
  for (const auto& [k, value] : x) {
    const double phi = value * y[k];
    if (phi <= 0 || !(s.square[k] > 0)) continue;
    b += phi * s.product[k];
    square += phi * phi * s.square[k];
    if (phi > 0.05) ++touched;
  }
  // Two poses would do for a line. What the rest of the model takes of a bump is seldom more than half.
  if (touched < 4 || !(b * b / (0.4 * square) / noise_scale2 - 4 * log_n > least)) return {};
  Eigen::VectorXd w = Eigen::VectorXd::Zero(s.basis.rows());
  for (const auto& [k, value] : x) {
    if (y[k] > 0 && s.square[k] > 0) w += value * y[k] * s.basis.col(k);
  }
  const double norm = square - w.squaredNorm();
  if (!(norm > 0.05 * square)) return {};
  const double gain = b * b / norm / noise_scale2 - 4 * log_n;
  if (!(gain > least)) return {};
  return gain;
}

Eigen::VectorXd at_every_row(const Touched& touched, Eigen::Index rows) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(rows);
  for (const auto& [k, value] : touched) out[k] = value;
  return out;
}

/// Splines of one reading on a grid over the turn.
struct SplineGrid {
  double spacing_rad;
  std::vector<double> centre_rad;
  std::vector<Touched> touched;
  std::vector<Eigen::VectorXd> value;
  SplineGrid(const Eigen::VectorXd& x, double spacing) : spacing_rad(spacing) {
    const int count = static_cast<int>(std::ceil(4 * pi / spacing));
    for (int c = 0; c < count; ++c) {
      centre_rad.push_back(-pi + 2 * pi * c / count);
      touched.push_back(touched_by(x, centre_rad.back(), spacing));
      value.push_back(at_every_row(touched.back(), x.size()));
    }
  }
};

/// The best bump of one joint over one pair of readings.
struct BumpScan {
  const PlaceProjection& joint;
  double noise_scale2;
  double log_n;
  double gain = 0;
  std::optional<Bump> best;

  void consider(const Bump& bump, const Touched& x, const Eigen::VectorXd& y) {
    const auto larger = gain_above(gain, joint, x, y, noise_scale2, log_n);
    if (!larger) return;
    gain = *larger;
    best = bump;
  }

  void search(const SplineGrid& first, const SplineGrid& second) {
    for (std::size_t x = 0; x < first.touched.size(); ++x) {
      for (std::size_t y = 0; y < second.value.size(); ++y)
        consider({{first.centre_rad[x], second.centre_rad[y]}, first.spacing_rad}, first.touched[x],
                 second.value[y]);
    }
  }

  /// Pattern search of centre and width around the best.
  void refine(const Eigen::VectorXd& x, const Eigen::VectorXd& y) {
    double step = 0.25;
    for (int round = 0; best && round < 5; ++round, step /= 2) {
      const Bump from = *best;
      for (const double dx : {-step, 0.0, step}) {
        for (const double dy : {-step, 0.0, step}) {
          for (const double wider : {1 - step, 1.0, 1 + step}) {
            const Bump bump{
                {from.centre_rad[0] + dx * from.spacing_rad, from.centre_rad[1] + dy * from.spacing_rad},
                from.spacing_rad * wider};
            consider(bump, touched_by(x, bump.centre_rad[0], bump.spacing_rad),
                     at_every_row(touched_by(y, bump.centre_rad[1], bump.spacing_rad), y.size()));
          }
        }
      }
    }
  }
};

}  // namespace

std::vector<SmoothFunction> bump_functions(const GapSystem& system, const ResidualAnalysis& left,
                                           const std::vector<Variable>& of, std::size_t most) {
  const double log_n = std::log(std::max(2.0, system.numbers));
  const std::vector<PlaceProjection> joints = joint_projections(system, left);
  std::vector<std::vector<SplineGrid>> grids(of.size());
  for (std::size_t v = 0; v < of.size(); ++v) {
    if (!of[v].is_joint_position()) continue;
    for (const double spacing : {0.5, 0.8, 1.2}) grids[v].emplace_back(of[v].value, spacing);
  }
  std::vector<SmoothFunction> all;
  for (std::size_t a = 0; a < of.size(); ++a) {
    for (std::size_t b = a + 1; b < of.size(); ++b) {
      if (grids[a].empty() || grids[b].empty()) continue;
      for (unsigned j = 1; j <= joint_count; ++j) {
        BumpScan scan{joints[j - 1], left.noise_scale2, log_n, 0, {}};
        for (std::size_t w = 0; w < grids[a].size(); ++w) scan.search(grids[a][w], grids[b][w]);
        scan.refine(of[a].value, of[b].value);
        if (!scan.best) continue;
        all.push_back({.place = {static_cast<std::uint8_t>(j), slot::theta},
                       .of = {a, b},
                       .size_rad = 1e-4,
                       .bump = scan.best,
                       .gain = scan.gain});
      }
    }
  }
  keep_best(all, most);
  return all;
}

}  // namespace flexcomp::host
