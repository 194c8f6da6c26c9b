// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/smooth_functions.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "diagnosis/spline.hpp"
#include "linalg/blas.hpp"
#include "linalg/decompositions.hpp"
#include "model/covariate.hpp"

namespace flexcomp::host {

std::string Variable::name() const { return is_order ? "order" : covariate_name(kind, joint); }

std::vector<Variable> variables(const std::vector<Observation>& rows, const Testable& can) {
  std::vector<Variable> list;
  const Eigen::Index n = static_cast<Eigen::Index>(rows.size());
  const auto add = [&](Covariate kind, unsigned joint, auto value) {
    Variable v;
    v.kind = kind;
    v.joint = joint;
    v.value.resize(n);
    for (Eigen::Index k = 0; k < n; ++k) v.value[k] = value(rows[static_cast<std::size_t>(k)]);
    if (v.value.maxCoeff() - v.value.minCoeff() > 1e-9) list.push_back(std::move(v));
  };
  for (unsigned j = 1; j <= joint_count; ++j)
    add(Covariate::joint_position, j, [j](const Observation& r) { return r.q_rad[j - 1]; });
  add(Covariate::payload, 0, [](const Observation& r) { return r.context.payload_kg; });
  if (can.temperature)
    add(Covariate::temperature, 0, [](const Observation& r) { return r.context.temperature_c; });
  if (can.time) add(Covariate::time, 0, [](const Observation& r) { return r.context.time_s; });
  for (unsigned j = 1; j <= joint_count; ++j) {
    if (can.direction[j - 1])
      add(Covariate::direction, j, [j](const Observation& r) { return r.context.direction[j - 1]; });
  }
  Variable order;
  order.is_order = true;
  order.value = Eigen::VectorXd::LinSpaced(n, 0, 1);
  list.push_back(std::move(order));
  return list;
}

namespace {

double value_of(const Bump& bump, double x, double y) {
  // 1 in the middle: 9/4 times the product of two splines of 2/3.
  return 2.25 * cardinal_spline(angle_difference(x, bump.centre_rad[0]) / bump.spacing_rad) *
         cardinal_spline(angle_difference(y, bump.centre_rad[1]) / bump.spacing_rad);
}

/// Members of a function of one variable, without the constant, each scaled by its prior standard deviation.
Eigen::MatrixXd members_of_one(const Variable& range, const Eigen::VectorXd& at, int harmonics) {
  const double low = range.value.minCoeff();
  const double high = range.value.maxCoeff();
  const Eigen::ArrayXd x = (2 * at.array() - low - high) / std::max(high - low, 1e-12);  // -1 … 1
  if (range.is_joint_position()) {
    Eigen::MatrixXd m(at.size(), 1 + 2 * harmonics);
    m.col(0) = x;
    for (int h = 1; h <= harmonics; ++h) {
      m.col(2 * h - 1) = (h * at.array()).sin() / std::sqrt(h);
      m.col(2 * h) = (h * at.array()).cos() / std::sqrt(h);
    }
    return m;
  }
  if (range.kind == Covariate::direction) return x.matrix();
  // Few values of a payload determine few powers.
  std::vector<double> distinct(range.value.data(), range.value.data() + range.value.size());
  std::ranges::sort(distinct);
  distinct.erase(std::unique(distinct.begin(), distinct.end(),
                             [&](double a, double b) { return b - a < 1e-6 * (high - low); }),
                 distinct.end());
  Eigen::MatrixXd m(at.size(), distinct.size() > 2 ? 2 : 1);
  m.col(0) = x;
  if (m.cols() > 1) m.col(1) = 0.5 * x.square();
  return m;
}

}  // namespace

Eigen::MatrixXd members(const SmoothFunction& function, const std::vector<Variable>& variables,
                        const std::vector<Eigen::VectorXd>& at) {
  const Variable& first = variables[function.of[0]];
  Eigen::MatrixXd all;
  if (function.bump) {
    all.resize(at[0].size(), 1);
    for (Eigen::Index k = 0; k < all.rows(); ++k) all(k, 0) = value_of(*function.bump, at[0][k], at[1][k]);
  } else if (function.of.size() == 1) {
    all = members_of_one(first, at[0], 2 * function.harmonics);
  } else {
    const Eigen::MatrixXd a = members_of_one(first, at[0], function.harmonics);
    const Eigen::MatrixXd b = members_of_one(variables[function.of[1]], at[1], function.harmonics);
    all.resize(a.rows(), a.cols() + b.cols() + a.cols() * b.cols());
    all << a, b, Eigen::MatrixXd(a.rows(), a.cols() * b.cols());
    for (Eigen::Index i = 0; i < a.cols(); ++i) {
      for (Eigen::Index k = 0; k < b.cols(); ++k)
        all.col(a.cols() + b.cols() + i * b.cols() + k) = a.col(i).cwiseProduct(b.col(k));
    }
  }
  if (function.share.size() == 0) return all;
  std::vector<Eigen::Index> stay;
  for (Eigen::Index k = 0; k < all.cols(); ++k) {
    if (function.share[k] > 0) stay.push_back(k);
  }
  return all(Eigen::all, stay) * function.share(stay).asDiagonal();
}

Eigen::MatrixXd members(const SmoothFunction& function, const std::vector<Variable>& variables) {
  std::vector<Eigen::VectorXd> at;
  for (const std::size_t v : function.of) at.push_back(variables[v].value);
  return members(function, variables, at);
}

std::vector<SmoothFunction> smooth_functions(const GapSystem& system, const ResidualAnalysis& left,
                                             const std::vector<Variable>& of, std::size_t most) {
  constexpr std::array<double, 4> sizes{30e-6, 100e-6, 300e-6, 1000e-6};  // rad
  std::vector<std::vector<std::size_t>> sets;
  for (std::size_t a = 0; a < of.size(); ++a) {
    sets.push_back({a});
    if (of[a].is_order) continue;
    for (std::size_t b = a + 1; b < of.size(); ++b) {
      if (of[b].is_order || of[a].kind == Covariate::direction) continue;
      sets.push_back({a, b});
    }
  }
  const double tried = 2 * std::log(static_cast<double>(sets.size() * joint_count * sizes.size()));
  const std::vector<PlaceProjection> joints = joint_projections(system, left);
  std::vector<SmoothFunction> all;
  for (const std::vector<std::size_t>& set : sets) {
    SmoothFunction kind;
    kind.of = set;
    const Eigen::MatrixXd phi = members(kind, of);
    for (unsigned j = 1; j <= joint_count; ++j) {
      // A joint that turns by its own direction is backlash.
      if (set.size() == 1 && of[set[0]].kind == Covariate::direction && of[set[0]].joint == j) continue;
      const PlaceProjection& s = joints[j - 1];
      const Eigen::MatrixXd weighted = s.square.cwiseSqrt().asDiagonal() * phi;
      const Eigen::MatrixXd a = (gram(weighted) - gram(product(s.basis, phi))) / left.noise_scale2;
      const Eigen::VectorXd b = phi.transpose() * s.product / left.noise_scale2;
      const SymmetricEigen eigen = symmetric_eigen(a);
      const Eigen::VectorXd along = eigen.vectors.transpose() * b;
      SmoothFunction f = kind;
      f.place = {static_cast<std::uint8_t>(j), slot::theta};
      f.gain = -1e300;
      for (const double size : sizes) {
        double gain = -tried;
        for (Eigen::Index k = 0; k < along.size(); ++k) {
          const double l = std::max(0.0, eigen.values[k]);
          gain += along[k] * along[k] / (l + 1 / (size * size)) - std::log1p(size * size * l);
        }
        if (gain > f.gain) {
          f.gain = gain;
          f.size_rad = size;
        }
      }
      all.push_back(f);
    }
  }
  keep_best(all, most);
  return all;
}

Eigen::VectorXd relevance(const Eigen::MatrixXd& information, const Eigen::VectorXd& right, double& gain) {
  constexpr int rounds = 100;
  constexpr double gone = 1e-8;
  const Eigen::Index n = right.size();
  Eigen::VectorXd variance = Eigen::VectorXd::Ones(n);
  gain = 0;
  for (int round = 0; round <= rounds; ++round) {
    // In members of which each has the prior 1: never singular.
    const Eigen::VectorXd size = variance.cwiseSqrt();
    Eigen::MatrixXd normal = size.asDiagonal() * information * size.asDiagonal();
    normal.diagonal().array() += 1;
    const Llt factor(normal);
    if (!factor.is_positive_definite()) break;
    const Eigen::VectorXd scaled = size.asDiagonal() * right;
    const Eigen::VectorXd mean = factor.solve(scaled);
    const Eigen::MatrixXd covariance = factor.inverse();
    const Eigen::VectorXd determined = 1 - covariance.diagonal().array();
    gain = mean.dot(scaled) - factor.log_det() - 2 * static_cast<double>((variance.array() > gone).count());
    if (round == rounds) break;
    for (Eigen::Index k = 0; k < n; ++k) {
      const double square = mean[k] * mean[k];
      variance[k] *= variance[k] > gone && square > 0 ? square / std::max(determined[k], 1e-12) : 0;
      variance[k] = variance[k] > gone ? std::min(variance[k], 1e4) : 0;
    }
  }
  return variance.cwiseSqrt();
}

}  // namespace flexcomp::host
