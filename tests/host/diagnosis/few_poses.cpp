// SPDX-License-Identifier: Apache-2.0
#include "host/diagnosis/few_poses.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>

#include "identification/validate.hpp"
#include "model/place.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

constexpr int orders = 20;

/// Position rows of a linearised model: residual, columns of geometry and frames, columns of the joints' rotations.
struct Positions {
  Eigen::VectorXd residual;
  Eigen::MatrixXd geometry;
  Eigen::MatrixXd joints;
  std::vector<std::array<double, joint_count>> q_rad;  // per row of three
};

Positions positions_of(const FewPoses& rows, const Identification& start,
                       const std::vector<Observation>& of) {
  Unknowns all = start.identifiability.fitted;
  Estimate at = start.fit.estimate;
  const auto own = static_cast<Eigen::Index>(all.count());
  for (std::uint8_t j = 1; j <= joint_count; ++j) {
    Term<double> term;
    term.place = {j, slot::theta};
    term.coefficient = 0;
    all.parameters.push_back({geometric_name(term.place), place_unit(term.place), {at.set.terms.size()}, {}});
    at.set.terms.push_back(term);
  }
  std::vector<Observation> equal = of;  // positions of equal weight, mm
  for (Observation& row : equal) {
    row.has_orientation = false;
    row.whitening.setZero();
    row.whitening.topLeftCorner<3, 3>() = 1e3 * Eigen::Matrix3d::Identity();
  }
  const Linearised lin = linearised(at, *prepare(at.set, rows.robot, "oracle"), equal, all);
  std::vector<Eigen::Index> taken;
  Positions out;
  for (std::size_t k = 0; k < of.size(); ++k) {
    for (Eigen::Index c = 0; c < 3; ++c) taken.push_back(6 * static_cast<Eigen::Index>(k) + c);
    out.q_rad.push_back(of[k].q_rad);
  }
  out.residual = lin.residual(taken);
  const Eigen::MatrixXd derivative = lin.derivative(taken, Eigen::all);
  out.geometry = derivative.leftCols(own);
  out.joints = derivative.rightCols(static_cast<Eigen::Index>(joint_count));
  return out;
}

double mean_norm(const Eigen::VectorXd& left_mm) {
  double sum = 0;
  for (Eigen::Index k = 0; k < left_mm.size(); k += 3) sum += left_mm.segment<3>(k).norm();
  return sum / (static_cast<double>(left_mm.size()) / 3) * 1e-3;
}

Eigen::MatrixXd fourier_columns(const Positions& p) {
  Eigen::MatrixXd out(p.residual.size(), 2 * orders * static_cast<Eigen::Index>(joint_count));
  Eigen::Index at = 0;
  for (std::size_t j = 0; j < joint_count; ++j) {
    for (int n = 1; n <= orders; ++n, at += 2) {
      for (Eigen::Index k = 0; k < p.residual.size(); ++k) {
        const double angle = n * p.q_rad[static_cast<std::size_t>(k / 3)][j];
        out(k, at) = p.joints(k, static_cast<Eigen::Index>(j)) * std::cos(angle);
        out(k, at + 1) = p.joints(k, static_cast<Eigen::Index>(j)) * std::sin(angle);
      }
    }
  }
  return out;
}

}  // namespace

std::optional<FewPoses> few_poses(const std::string& series, std::size_t poses, unsigned draw) {
  const auto arm = measured_arm(series == "ur5" ? "ur5-jacobi" : "ur10-ipa");
  if (!arm) return {};
  const std::string file = series == "ur5"      ? "grid.csv"
                           : series == "ur10-a" ? "series_a.csv"
                                                : "series_b.csv";
  FewPoses out;
  out.robot = arm->robot;
  out.columns = load_data(arm->folder + file, arm->robot).columns;
  std::vector<Observation> rows = arm->rows(file);
  std::mt19937 random(1000 + draw);
  std::shuffle(rows.begin(), rows.end(), random);
  const auto from = static_cast<std::ptrdiff_t>(poses);
  const auto to = static_cast<std::ptrdiff_t>(std::min(rows.size(), poses + 1000));
  out.train.assign(rows.begin(), rows.begin() + from);
  out.test.assign(rows.begin() + from, rows.begin() + to);
  return out;
}

double mean_with(const FewPoses& rows, const Calibration& calibration) {
  return validate(rows.robot, calibration, rows.test, "held out").after.mean_m;
}

double mean_of_ridge(const FewPoses& rows, const Identification& start) {
  const Positions train = positions_of(rows, start, rows.train);
  const Positions test = positions_of(rows, start, rows.test);
  const Eigen::MatrixXd curves = fourier_columns(train);
  const Eigen::Index own = train.geometry.cols();
  Eigen::MatrixXd x(train.residual.size(), own + curves.cols());
  x << train.geometry, curves;
  const Eigen::MatrixXd gram = x.transpose() * x;
  const Eigen::VectorXd right = x.transpose() * train.residual;
  double least = std::numeric_limits<double>::infinity();
  Eigen::VectorXd best;
  for (double power = -4; power <= 6; power += 0.5) {
    Eigen::MatrixXd normal = gram;
    normal.diagonal().head(own).array() += 1e-6;
    normal.diagonal().tail(curves.cols()).array() += std::pow(10.0, power) * gram.diagonal().mean() * 1e-3;
    const Eigen::LDLT<Eigen::MatrixXd> factor(normal);
    const Eigen::VectorXd solution = factor.solve(right);
    const Eigen::VectorXd left = train.residual - x * solution;
    const Eigen::MatrixXd to_fit = factor.solve(Eigen::MatrixXd(x.transpose()));
    double sum = 0;
    for (Eigen::Index k = 0; k < left.size(); k += 3) {
      const Eigen::Matrix3d others =
          Eigen::Matrix3d::Identity() - x.middleRows<3>(k) * to_fit.middleCols<3>(k);
      sum += (others.inverse() * left.segment<3>(k)).squaredNorm();
    }
    if (!(sum < least)) continue;
    least = sum;
    best = solution;
  }
  Eigen::MatrixXd x_test(test.residual.size(), x.cols());
  x_test << test.geometry, fourier_columns(test);
  return mean_norm(test.residual - x_test * best);
}

namespace {

/// Covariance of a Gaussian process over differences of angles: flat to the corner, then falling by the fourth power.
std::vector<double> kernel_table(double corner) {
  std::vector<double> table(3600);
  double sum = 0;
  for (int n = 1; n <= 60; ++n) sum += 1 / (1 + std::pow(n / corner, 4));
  for (std::size_t k = 0; k < table.size(); ++k) {
    for (int n = 1; n <= 60; ++n)
      table[k] += std::cos(n * 2 * pi * static_cast<double>(k) / 3600) / (1 + std::pow(n / corner, 4)) / sum;
  }
  return table;
}

Eigen::MatrixXd covariance_between(const Positions& a, const Positions& b, const Eigen::VectorXd& log_size,
                                   double corner) {
  const std::vector<double> table = kernel_table(corner);
  Eigen::MatrixXd out = 1e4 * a.geometry * b.geometry.transpose();
  for (std::size_t j = 0; j < joint_count; ++j) {
    const auto c = static_cast<Eigen::Index>(j);
    const double variance = std::exp(2 * log_size[c]);
    for (std::size_t r = 0; r < a.q_rad.size(); ++r) {
      for (std::size_t s = 0; s < b.q_rad.size(); ++s) {
        const double turn = std::abs(std::remainder(a.q_rad[r][j] - b.q_rad[s][j], 2 * pi));
        const double k = variance * table[static_cast<std::size_t>(turn / (2 * pi) * 3600) % 3600];
        const auto i = 3 * static_cast<Eigen::Index>(r);
        const auto l = 3 * static_cast<Eigen::Index>(s);
        out.block<3, 3>(i, l) +=
            k * a.joints.col(c).segment<3>(i) * b.joints.col(c).segment<3>(l).transpose();
      }
    }
  }
  return out;
}

}  // namespace

double mean_of_gaussian_processes(const FewPoses& rows, const Identification& start) {
  const Positions train = positions_of(rows, start, rows.train);
  const Positions test = positions_of(rows, start, rows.test);
  // Logarithms: sizes in units of the joints' columns, corner, noise in mm.
  constexpr Eigen::Index corner_at = static_cast<Eigen::Index>(joint_count), noise_at = corner_at + 1;
  Eigen::VectorXd at = Eigen::VectorXd::Constant(noise_at + 1, std::log(0.2));
  at[corner_at] = std::log(10.0);
  at[noise_at] = std::log(0.05);
  const auto value = [&](const Eigen::VectorXd& log) {
    Eigen::MatrixXd k = covariance_between(train, train, log.head(corner_at), std::exp(log[corner_at]));
    k.diagonal().array() += std::exp(2 * log[noise_at]);
    const Eigen::LLT<Eigen::MatrixXd> factor(k);
    if (factor.info() != Eigen::Success) return -std::numeric_limits<double>::infinity();
    const Eigen::MatrixXd lower = factor.matrixL();
    return -train.residual.dot(factor.solve(train.residual)) - 2 * lower.diagonal().array().log().sum();
  };
  double best = value(at);
  for (const double step : {1.2, 0.6, 0.3}) {
    for (Eigen::Index i = 0; i < at.size(); ++i) {
      for (const double sign : {1.0, -1.0}) {
        bool moved = false;
        for (;;) {
          Eigen::VectorXd next = at;
          next[i] += sign * step;
          if (next[corner_at] > std::log(40.0) || next[corner_at] < 0 || next[i] < -9) break;
          const double there = value(next);
          if (!(there > best)) break;
          best = there;
          at = next;
          moved = true;
        }
        if (moved) break;
      }
    }
  }
  Eigen::MatrixXd k = covariance_between(train, train, at.head(corner_at), std::exp(at[corner_at]));
  k.diagonal().array() += std::exp(2 * at[noise_at]);
  const Eigen::VectorXd weight = Eigen::LLT<Eigen::MatrixXd>(k).solve(train.residual);
  const Eigen::MatrixXd across = covariance_between(test, train, at.head(corner_at), std::exp(at[corner_at]));
  return mean_norm(test.residual - across * weight);
}

}  // namespace flexcomp::host
