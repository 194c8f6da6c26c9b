// SPDX-License-Identifier: Apache-2.0
#include "measurement/reflectors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "distributions.hpp"
#include "linalg/decompositions.hpp"
#include "model/frames.hpp"

namespace flexcomp::host {

namespace {

Eigen::Vector3d centroid(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) sum += p;
  return sum / static_cast<double>(points.size());
}

Points transformed(const Pose<double>& pose, std::span<const Eigen::Vector3d> points) {
  Points out;
  for (const Eigen::Vector3d& p : points) out.emplace_back(pose.rotation * p + pose.position);
  return out;
}

/// Derivative of a point for [position; rotation vector] of its frame: dp + phi x r.
Eigen::Matrix<double, 3, 6> point_jacobian(const Eigen::Vector3d& r) {
  Eigen::Matrix<double, 3, 6> j;
  j.leftCols<3>().setIdentity();
  j.rightCols<3>() << 0, r.z(), -r.y(), -r.z(), 0, r.x(), r.y(), -r.x(), 0;
  return j;
}

/// All points but one, and that one.
struct Others {
  Points points;
  Eigen::Vector3d left_out;
};

Others apart(std::span<const Eigen::Vector3d> points, std::size_t leave) {
  Others out{{}, points[leave]};
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (k != leave) out.points.push_back(points[k]);
  }
  return out;
}

/// Cylindrical coordinates of the left-out point about the line of the two others: along it from their
/// midpoint, radius.
Eigen::Vector2d about_line(const Others& o) {
  const Eigen::Vector3d along = (o.points[1] - o.points[0]).normalized();
  const Eigen::Vector3d from_middle = o.left_out - (o.points[0] + o.points[1]) / 2;
  return {along.dot(from_middle), along.cross(from_middle).norm()};
}

/// Logarithm of the product of singular values of the deformation by a motion of this point: the motion with the best
/// rigid motion projected out.
double log_sensitivity(std::span<const Eigen::Vector3d> points, std::size_t moved) {
  const auto rows = static_cast<Eigen::Index>(3 * points.size());
  const Eigen::Vector3d middle = centroid(points);
  double size = 0;
  for (const Eigen::Vector3d& p : points) size = std::max(size, (p - middle).norm());
  Eigen::MatrixXd rigid(rows, 6);
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Eigen::Vector3d r = (points[k] - middle) / size;
    rigid.middleRows<3>(static_cast<Eigen::Index>(3 * k)) = point_jacobian(r);
  }
  const Eigen::MatrixXd q = orthogonal_factor(rigid);
  const Eigen::MatrixXd deformation =
      q.rightCols(rows - 6).transpose().middleCols(static_cast<Eigen::Index>(3 * moved), 3);
  double sum = 0;
  const Eigen::VectorXd seen = singular_values(deformation);
  for (const double s : seen) {
    if (s > 1e-6) sum += std::log(s);
  }
  return sum;
}

}  // namespace

RigidFit fit_rigid(std::span<const Eigen::Vector3d> measured_m, std::span<const Eigen::Vector3d> template_m) {
  return fit_rigid(measured_m, template_m, std::vector<double>(template_m.size(), 1));
}

RigidFit fit_rigid(std::span<const Eigen::Vector3d> measured_m, std::span<const Eigen::Vector3d> template_m,
                   std::span<const double> sigma_m) {
  double total = 0;
  Eigen::Vector3d from = Eigen::Vector3d::Zero();
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
  std::vector<double> weight;
  for (std::size_t k = 0; k < template_m.size(); ++k) {
    weight.push_back(1 / (sigma_m[k] * sigma_m[k]));
    from += weight[k] * template_m[k];
    to += weight[k] * measured_m[k];
    total += weight[k];
  }
  from /= total;
  to /= total;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t k = 0; k < template_m.size(); ++k) {
    covariance += weight[k] * (measured_m[k] - to) * (template_m[k] - from).transpose();
  }
  RigidFit fit;
  fit.pose.rotation = nearest_rotation(covariance);
  fit.pose.position = to - fit.pose.rotation * from;
  for (std::size_t k = 0; k < template_m.size(); ++k) {
    fit.squares_m2 += (measured_m[k] - fit.pose.rotation * template_m[k] - fit.pose.position).squaredNorm();
  }
  return fit;
}

Pose<double> reflector_frame(std::span<const Eigen::Vector3d> points_m) {
  const Eigen::Vector3d& a = points_m[0];
  const Eigen::Vector3d& b = points_m[1];
  const Eigen::Vector3d& c = points_m[2];
  Pose<double> frame;
  const Eigen::Vector3d y = (a - c).normalized();
  frame.position = c + y * y.dot(b - c);
  const Eigen::Vector3d x = (frame.position - b).normalized();
  frame.rotation.col(0) = x;
  frame.rotation.col(1) = y;
  frame.rotation.col(2) = x.cross(y);
  return frame;
}

Points estimate_template(const std::vector<Points>& rows_m) {
  Points shape = transformed(inverse(reflector_frame(rows_m.front())), rows_m.front());
  // Each row is fitted to the mean, and a new mean is taken. One round leaves the square of the relative noise; at most
  // twenty.
  for (int k = 0; k < 20; ++k) {
    Points sum(shape.size(), Eigen::Vector3d::Zero());
    for (const Points& row : rows_m) {
      const Points laid = transformed(inverse(fit_rigid(row, shape).pose), row);
      for (std::size_t r = 0; r < sum.size(); ++r) sum[r] += laid[r];
    }
    double change = 0;
    for (std::size_t r = 0; r < sum.size(); ++r) {
      sum[r] /= static_cast<double>(rows_m.size());
      change += (sum[r] - shape[r]).squaredNorm();
    }
    shape = sum;
    if (change < 1e-24) break;
  }
  return transformed(inverse(reflector_frame(shape)), shape);
}

bool on_one_line(std::span<const Eigen::Vector3d> points_m) {
  const Eigen::Vector3d along = points_m[2] - points_m[0];
  const double length = along.norm();
  return length < 1e-4 || along.cross(points_m[1] - points_m[0]).norm() / length < 1e-4;
}

Eigen::Matrix<double, 6, 6> fit_information(const Pose<double>& pose,
                                            std::span<const Eigen::Vector3d> template_m, double sigma_m) {
  return fit_information(pose, template_m, std::vector<double>(template_m.size(), sigma_m));
}

Eigen::Matrix<double, 6, 6> fit_information(const Pose<double>& pose,
                                            std::span<const Eigen::Vector3d> template_m,
                                            std::span<const double> sigma_m) {
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  for (std::size_t k = 0; k < template_m.size(); ++k) {
    const Eigen::Vector3d r = pose.rotation * template_m[k];
    const Eigen::Matrix<double, 3, 6> j = point_jacobian(r);
    information += j.transpose() * j / (sigma_m[k] * sigma_m[k]);
  }
  return information;
}

double misfit_probability(double chi2, std::size_t dof) {
  // Closed forms: three points leave 9 - 6 degrees of freedom, four 12 - 6.
  const double half = chi2 / 2;
  if (dof == 6) return std::exp(-half) * (1 + half + half * half / 2);
  return std::erfc(std::sqrt(half)) + std::sqrt(half / std::acos(-1.0)) * 2 * std::exp(-half);
}

Suspicion suspect_reflectors(const std::vector<Points>& rows_m, std::span<const Eigen::Vector3d> template_m,
                             double sigma_m) {
  const std::size_t n = template_m.size();
  const Points shape = estimate_template(rows_m);
  const double sigma = sigma_m / std::sqrt(static_cast<double>(rows_m.size()));
  // Likelihood of each reflector having moved: distance moved, and chi-square of the others.
  std::vector<double> log_weight(n);
  double least_chi2 = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < n; ++k) {
    const Others measured = apart(shape, k);
    const Others drawn = apart(template_m, k);
    const RigidFit fit = fit_rigid(measured.points, drawn.points);
    const double chi2 = fit.squares_m2 / (sigma * sigma);
    // Two others leave the rotation about their line open: only the motion along and off that line is observable.
    const double move =
        n == 3 ? (about_line(measured) - about_line(drawn)).norm()
               : (measured.left_out - fit.pose.rotation * drawn.left_out - fit.pose.position).norm();
    const double directions = n == 3 ? 2 : 3;
    log_weight[k] = -chi2 / 2 - directions * std::log(std::max(move, sigma)) - log_sensitivity(template_m, k);
    least_chi2 = std::min(least_chi2, chi2);
  }
  Suspicion out;
  out.several = chi2_above(least_chi2, n == 3 ? 1 : 3) < 1e-6;
  const double largest = *std::max_element(log_weight.begin(), log_weight.end());
  double sum = 0;
  for (const double w : log_weight) sum += std::exp(w - largest);
  for (const double w : log_weight) out.probability.push_back(std::exp(w - largest) / sum);
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t i, std::size_t j) { return out.probability[i] > out.probability[j]; });
  double sum_named = 0;
  for (const std::size_t k : order) {
    if (sum_named >= 0.99) break;
    sum_named += out.probability[k];
    out.named.push_back(k);
  }
  return out;
}

bool same_shape(const std::vector<Points>& rows_m, double sigma_m) {
  if (rows_m.size() < 2) return true;
  const Points mean = estimate_template(rows_m);
  double squares = 0;
  for (const Points& row : rows_m) squares += fit_rigid(row, mean).squares_m2;
  const double dof = static_cast<double>((rows_m.size() - 1) * (3 * mean.size() - 6));
  return chi2_above(squares / (sigma_m * sigma_m), dof) > 1e-4;
}

}  // namespace flexcomp::host
