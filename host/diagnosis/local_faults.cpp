// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/local_faults.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "diagnosis/spline.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {

namespace {

/// Rows in the order of a joint's folded reading.
using Order = std::vector<std::pair<double, Eigen::Index>>;

/// Reduction of chi-square by one spline of a joint's reading (D7); nothing where too few rows, or the model's own
/// parameters, leave it undetermined.
std::optional<double> chi2_gain_at(double centre, double spacing, const PlaceProjection& s,
                                   const Order& order, std::size_t least_touched) {
  double b = 0;
  double square = 0;
  std::size_t touched = 0;
  Eigen::VectorXd w = Eigen::VectorXd::Zero(s.basis.rows());
  // Rows inside the support, over the end of the turn as well.
  const auto visit = [&](double from, double to) {
    for (auto at = std::ranges::lower_bound(order, std::pair{from, Eigen::Index{-1}});
         at != order.end() && at->first < to; ++at) {
      const double phi = cardinal_spline(angle_difference(at->first, centre) / spacing);
      if (phi <= 0 || !(s.square[at->second] > 0)) continue;
      b += phi * s.product[at->second];
      square += phi * phi * s.square[at->second];
      w += phi * s.basis.col(at->second);
      if (phi > 0.1) ++touched;
    }
  };
  visit(centre - 2 * spacing, centre + 2 * spacing);
  if (centre - 2 * spacing < -pi) visit(centre - 2 * spacing + 2 * pi, pi + 1e-9);
  if (centre + 2 * spacing > pi) visit(-pi - 1e-9, centre + 2 * spacing - 2 * pi);
  const double norm = square - w.squaredNorm();
  if (touched < least_touched || !(norm > 0.05 * square)) return {};
  return b * b / norm;
}

}  // namespace

double LocalCurve::spacing_rad() const { return 2 * pi / static_cast<double>(knots); }

Eigen::VectorXd local_values(const LocalCurve& curve, const std::vector<Observation>& rows) {
  Eigen::VectorXd v(static_cast<Eigen::Index>(rows.size()));
  const double per_rad = static_cast<double>(curve.knots) / (2 * pi);
  for (std::size_t k = 0; k < rows.size(); ++k)
    v[static_cast<Eigen::Index>(k)] =
        cardinal_spline(angle_difference(rows[k].q_rad[curve.joint - 1], curve.centre_rad) * per_rad);
  return v;
}

std::vector<LocalCurve> local_curves(const GapSystem& system, const ResidualAnalysis& left,
                                     const std::vector<Observation>& rows, std::size_t per_joint,
                                     std::size_t least_touched) {
  std::vector<LocalCurve> chosen;
  const double log_n = std::log(std::max(2.0, system.numbers));
  const std::vector<PlaceProjection> joints = joint_projections(system, left);
  for (unsigned joint = 1; joint <= joint_count; ++joint) {
    Order order;
    for (std::size_t k = 0; k < rows.size(); ++k)
      order.emplace_back(angle_difference(rows[k].q_rad[joint - 1], 0), static_cast<Eigen::Index>(k));
    std::ranges::sort(order);
    std::vector<LocalCurve> all;
    for (const std::size_t knots : {24U, 36U, 48U, 72U, 96U}) {
      const double spacing = 2 * pi / static_cast<double>(knots);
      for (std::size_t c = 0; c < 2 * knots; ++c) {
        const double centre = -pi + 0.5 * spacing * static_cast<double>(c);
        const auto gain = chi2_gain_at(centre, spacing, joints[joint - 1], order, least_touched);
        if (gain) all.push_back({joint, knots, centre, *gain / left.noise_scale2 - 2 * log_n});
      }
    }
    keep_best(all, all.size());
    std::size_t taken = 0;
    for (const LocalCurve& c : all) {
      if (taken >= per_joint || !(c.gain > 0)) break;
      const bool near = std::ranges::any_of(chosen, [&](const LocalCurve& other) {
        return other.joint == joint && std::abs(angle_difference(other.centre_rad, c.centre_rad)) <
                                           other.spacing_rad() + c.spacing_rad();
      });
      if (near) continue;
      chosen.push_back(c);
      ++taken;
    }
  }
  return chosen;
}

std::vector<Slip> slips(const GapSystem& system, const ResidualAnalysis& left,
                        const std::vector<Observation>& rows,
                        const std::array<Eigen::VectorXd, 3>& point_columns, std::size_t most) {
  const Eigen::Index n = static_cast<Eigen::Index>(rows.size());
  std::vector<Eigen::Index> order(rows.size());
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  const auto time = [&](Eigen::Index k) { return rows[static_cast<std::size_t>(k)].context.time_s; };
  std::ranges::stable_sort(order, [&](Eigen::Index a, Eigen::Index b) { return time(a) > time(b); });
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(left.basis.cols(), 3);
  std::vector<Slip> all;
  const double log_n = std::log(std::max(2.0, system.numbers));
  // A step of a handful of rows is a handful of outliers.
  for (Eigen::Index i = 0; i + 1 < n; ++i) {
    const Eigen::Index k = order[static_cast<std::size_t>(i)];
    Eigen::Matrix<double, 6, 3> u;
    for (int c = 0; c < 3; ++c) u.col(c) = point_columns[static_cast<std::size_t>(c)].segment<6>(6 * k);
    normal += u.transpose() * u;
    right += u.transpose() * left.residual.segment<6>(6 * k);
    basis += left.basis.middleRows<6>(6 * k).transpose() * u;
    const Eigen::Index before = order[static_cast<std::size_t>(i + 1)];
    if (!(time(before) < time(k)) || i < 4 || i + 6 > n) continue;
    const Eigen::Matrix3d a = normal - basis.transpose() * basis;
    const Llt factor(a);
    if (!factor.is_positive_definite()) continue;
    all.push_back({0.5 * (time(before) + time(k)),
                   right.dot(factor.solve(Eigen::VectorXd(right))) / left.noise_scale2 - 4 * log_n});
  }
  keep_best(all, most);
  return all;
}

}  // namespace flexcomp::host
