// SPDX-License-Identifier: Apache-2.0
#include "measurement/repeats.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "distributions.hpp"
#include "linalg/decompositions.hpp"
#include "quaternion.hpp"

namespace flexcomp::host {

namespace {

constexpr double same_reading_rad = 1e-9;

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// True where two rows have the same joint readings and context.
bool same_pose(const Observation& a, const Observation& b) {
  for (std::size_t j = 0; j < joint_count; ++j) {
    if (std::abs(a.q_rad[j] - b.q_rad[j]) > same_reading_rad) return false;
  }
  const auto& x = a.context;
  const auto& y = b.context;
  return a.has_orientation == b.has_orientation && x.payload_kg == y.payload_kg &&
         x.payload_com_m == y.payload_com_m && x.force_n == y.force_n && x.temperature_c == y.temperature_c &&
         x.time_s == y.time_s && x.direction == y.direction && x.relative_speed == y.relative_speed;
}

/// Deviations of one group from a common pose near all of them: its mean to first order in the scatter.
std::vector<Vector6d> deviations(const std::vector<Observation>& rows,
                                 const std::vector<std::size_t>& group) {
  Eigen::Matrix3d middle = rows[group[0]].R;
  if (rows[group[0]].has_orientation) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const std::size_t k : group) mean += rotation_between(rows[k].R, middle);
    mean /= static_cast<double>(group.size());
    if (mean.norm() > 0)
      middle = Eigen::AngleAxisd(mean.norm(), mean.normalized()).toRotationMatrix() * middle;
  }
  std::vector<Vector6d> out;
  for (const std::size_t k : group) {
    Vector6d e = Vector6d::Zero();
    e.head<3>() = rows[k].p_m - rows[group[0]].p_m;
    if (rows[k].has_orientation) e.tail<3>() = rotation_between(rows[k].R, middle);
    out.push_back(e);
  }
  return out;
}

/// Sum of squares about the weighted mean of a group, whitened by the declared noise: chi-square distributed with
/// (size - 1) * numbers degrees of freedom where that noise is right.
double whitened_squares(const std::vector<Observation>& rows, const std::vector<std::size_t>& group,
                        const std::vector<Vector6d>& e) {
  const Eigen::Index n = rows[group[0]].has_orientation ? 6 : 3;
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(n);
  for (std::size_t i = 0; i < group.size(); ++i) {
    const Eigen::MatrixXd w = rows[group[i]].whitening.topLeftCorner(n, n);
    information += w.transpose() * w;
    sum += w.transpose() * (w * e[i].head(n));
  }
  const Eigen::VectorXd mean = Llt(information).solve(sum);
  double squares = 0;
  for (std::size_t i = 0; i < group.size(); ++i) {
    squares += (rows[group[i]].whitening.topLeftCorner(n, n) * (e[i].head(n) - mean)).squaredNorm();
  }
  return squares;
}

/// Declared covariance of one row; zero where not measured.
Matrix6d declared_covariance(const Observation& row) {
  Matrix6d covariance = Matrix6d::Zero();
  const Eigen::Index n = row.has_orientation ? 6 : 3;
  const Eigen::MatrixXd w = row.whitening.topLeftCorner(n, n);
  covariance.topLeftCorner(n, n) = inverse(w.transpose() * w);
  return covariance;
}

/// Effective degrees of freedom of a sum of squares over three axes of unequal variance (Satterthwaite); three
/// per free row for equal ones. The declared covariance is used: the estimated one is too uncertain with few
/// rows.
class SquaresOfAxes {
 public:
  void add(const Eigen::Matrix3d& covariance, double free_rows) {
    mean_ += free_rows * covariance.trace();
    variance_ += free_rows * covariance.squaredNorm();
    free_rows_ += free_rows;
  }
  /// Standard deviation per axis from the sum of squares, with its interval.
  double sigma(double squares, Interval& interval) const {
    if (!(free_rows_ > 0)) return 0;
    const double dof = mean_ * mean_ / variance_;
    const double variance = squares / (3 * free_rows_);
    interval.low = std::sqrt(variance * dof / chi2_quantile(0.975, dof));
    interval.high = std::sqrt(variance * dof / chi2_quantile(0.025, dof));
    return std::sqrt(variance);
  }

 private:
  double mean_ = 0;
  double variance_ = 0;
  double free_rows_ = 0;
};

}  // namespace

std::vector<std::vector<std::size_t>> repeats(const std::vector<Observation>& rows) {
  // In the order of the first joint's reading, so that only near neighbours are compared.
  std::vector<std::size_t> order(rows.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return rows[a].q_rad[0] < rows[b].q_rad[0]; });
  std::vector<std::vector<std::size_t>> groups;
  std::vector<bool> taken(rows.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Observation& first = rows[order[i]];
    if (taken[order[i]]) continue;
    std::vector<std::size_t> group{order[i]};
    for (std::size_t j = i + 1; j < order.size(); ++j) {
      if (rows[order[j]].q_rad[0] - first.q_rad[0] > same_reading_rad) break;
      if (taken[order[j]] || !same_pose(first, rows[order[j]])) continue;
      taken[order[j]] = true;
      group.push_back(order[j]);
    }
    if (group.size() < 2) continue;
    std::sort(group.begin(), group.end());
    groups.push_back(group);
  }
  std::sort(groups.begin(), groups.end());
  return groups;
}

std::optional<PureError> pure_error(const std::vector<Observation>& rows, double fit_chi2, double fit_dof) {
  PureError out;
  SquaresOfAxes position;
  SquaresOfAxes orientation;
  double whitened = 0;
  double free_rows = 0;
  double free_oriented = 0;
  for (const std::vector<std::size_t>& group : repeats(rows)) {
    const std::vector<Vector6d> e = deviations(rows, group);
    Vector6d mean = Vector6d::Zero();
    for (const Vector6d& v : e) mean += v / static_cast<double>(e.size());
    Matrix6d noise = Matrix6d::Zero();
    for (std::size_t i = 0; i < group.size(); ++i) {
      out.covariance += (e[i] - mean) * (e[i] - mean).transpose();
      noise += declared_covariance(rows[group[i]]) / static_cast<double>(e.size());
    }
    const double freed = static_cast<double>(group.size() - 1);
    position.add(noise.topLeftCorner<3, 3>(), freed);
    free_rows += freed;
    if (rows[group[0]].has_orientation) {
      orientation.add(noise.bottomRightCorner<3, 3>(), freed);
      free_oriented += freed;
    }
    whitened += whitened_squares(rows, group, e);
    out.dof += freed * (rows[group[0]].has_orientation ? 6 : 3);
    out.rows += group.size();
    ++out.groups;
  }
  if (out.groups == 0) return {};
  out.sigma_position_m =
      position.sigma(out.covariance.topLeftCorner<3, 3>().trace(), out.position_interval_m);
  out.sigma_orientation_rad =
      orientation.sigma(out.covariance.bottomRightCorner<3, 3>().trace(), out.orientation_interval_rad);
  out.covariance.topLeftCorner<3, 3>() /= free_rows;
  if (free_oriented > 0) {
    out.covariance.topRightCorner<3, 3>() /= free_oriented;
    out.covariance.bottomLeftCorner<3, 3>() /= free_oriented;
    out.covariance.bottomRightCorner<3, 3>() /= free_oriented;
  }
  out.chi2_per_dof_whitened = whitened / out.dof;
  const double lacking = fit_dof - out.dof;
  if (lacking > 0 && whitened > 0) {
    out.lack_of_fit_f = std::max(fit_chi2 - whitened, 0.0) / lacking / out.chi2_per_dof_whitened;
    out.lack_of_fit_p = fisher_f_above(*out.lack_of_fit_f, lacking, out.dof);
  }
  return out;
}

}  // namespace flexcomp::host
