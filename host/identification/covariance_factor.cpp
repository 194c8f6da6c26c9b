// SPDX-License-Identifier: Apache-2.0
#include "identification/covariance_factor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>

#include "flexcomp/forward.hpp"
#include "linalg/blas.hpp"
#include "linalg/decompositions.hpp"
#include "model/host_model.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Parameters of a fit, as indices into its covariance.
struct Parts {
  std::vector<Index> others;  ///< frames, geometry, effects with numbers of their own
  std::vector<Index> curves;  ///< coefficients of curves
  struct Coefficient {
    std::uint16_t table = 0;
    std::size_t index = 0;  ///< in its table
  };
  std::vector<Coefficient> coefficients;  ///< of `curves`
};

Parts parts_of(const Unknowns& fitted, const TermSet& set) {
  Parts out;
  for (std::size_t i = 0; i < fitted.count(); ++i) {
    const auto index = static_cast<Index>(i);
    const Parameter* p = i < fitted.frames.size() ? nullptr : &fitted.parameters[i - fitted.frames.size()];
    if (p == nullptr || !p->value || set.terms[p->terms.front()].basis != Basis::curve) {
      out.others.push_back(index);
      continue;
    }
    const std::uint16_t table = set.terms[p->terms.front()].table;
    out.curves.push_back(index);
    out.coefficients.push_back({table, *p->value - set.tables[table].offset});
  }
  return out;
}

/// Some of the fitted rows, and as many random poses within the readings that they have.
std::vector<Observation> reference_poses(const std::vector<Observation>& rows) {
  constexpr std::size_t most = 200;
  std::vector<Observation> out;
  if (rows.empty()) return out;
  const std::size_t count = std::min(rows.size(), most);
  for (std::size_t k = 0; k < count; ++k) out.push_back(rows[k * rows.size() / count]);
  std::mt19937_64 random(1);
  for (std::size_t k = 0; k < most; ++k) out.push_back(rows[random() % rows.size()]);
  for (std::size_t j = 0; j < joint_count; ++j) {
    const auto [least, largest] = std::ranges::minmax_element(
        rows, [j](const Observation& a, const Observation& b) { return a.q_rad[j] < b.q_rad[j]; });
    for (std::size_t k = count; k < out.size(); ++k) {
      const double share = static_cast<double>(random() >> 11U) * 0x1p-53;
      out[k].q_rad[j] = least->q_rad[j] + share * (largest->q_rad[j] - least->q_rad[j]);
    }
  }
  return out;
}

/// S with tr(S R) = sum over the reference poses of the share of R in the variance of their prediction.
MatrixXd share_of_variance(const Fit& fit, const Unknowns& fitted, const Robot& robot,
                           const std::vector<Observation>& poses, const std::vector<Index>& curves) {
  const auto model = prepare(fit.estimate.set, robot, robot.path);
  const MatrixXd derivative = linearised(fit.estimate, *model, poses, fitted).derivative;
  const VectorXd variance = product(derivative, fit.covariance).cwiseProduct(derivative).rowwise().sum();
  MatrixXd scaled = derivative(Eigen::all, curves);
  for (Index k = 0; k < scaled.rows(); k += 6) {
    const double of_pose = variance.segment<6>(k).sum();
    if (of_pose > 0) scaled.middleRows<6>(k) /= std::sqrt(of_pose);
  }
  return gram(scaled);
}

/// Cholesky columns of R over pivots, each of which takes most of tr(S R).
MatrixXd pivoted_columns(const MatrixXd& r, const MatrixXd& s, double poses) {
  constexpr double negligible = 1e-4;   // of the variance of a prediction
  constexpr double least_pivot = 1e-6;  // of the variance of a coefficient
  const Index n = r.rows();
  MatrixXd out(n, std::min(n, curve_numbers / n));
  const VectorXd variance = r.diagonal();
  VectorXd left = variance;
  const MatrixXd sr = product(s, r);
  double share = sr.trace();
  VectorXd taken = r.cwiseProduct(sr.transpose()).rowwise().sum();  // diagonal of R S R
  Index k = 0;
  for (; k < out.cols() && share > negligible * poses; ++k) {
    Index pivot = -1;
    for (Index i = 0; i < n; ++i) {
      if (left[i] <= least_pivot * variance[i]) continue;
      if (pivot < 0 || taken[i] * left[pivot] > taken[pivot] * left[i]) pivot = i;
    }
    if (pivot < 0) break;
    const auto before = out.leftCols(k);
    const VectorXd f = (r.col(pivot) - before * before.row(pivot).transpose()) / std::sqrt(left[pivot]);
    const VectorXd sf = product(s, f);
    const VectorXd rsf = product(r, sf) - before * (before.transpose() * sf);
    const double gain = f.dot(sf);
    taken += f.cwiseProduct(gain * f - 2 * rsf);
    left -= f.cwiseAbs2();
    share -= gain;
    out.col(k) = f;
  }
  return out.leftCols(k);
}

/// Variances d of independent coefficients by which the curves are as uncertain, on average over the turn, as by R.
/// Neighbouring coefficients are correlated, so that the diagonal of R alone would say less: at a knot half as much where
/// the correlation is 1.
VectorXd independent_variances(const MatrixXd& r, const Parts& parts, const TermSet& set) {
  std::map<std::uint16_t, std::map<std::size_t, Index>> tables;
  for (std::size_t k = 0; k < parts.curves.size(); ++k)
    tables[parts.coefficients[k].table][parts.coefficients[k].index] = static_cast<Index>(k);
  VectorXd out = r.diagonal().cwiseMax(0);
  for (const auto& [table, fitted] : tables) {
    const std::uint16_t size = set.tables[table].size;
    double correlated = 0, independent = 0;
    for (int half = 0; half < 2 * size; ++half) {  // at the knots and between them
      const auto weights = detail::curve_weights(pi * half / size, size);
      std::vector<std::pair<Index, double>> at;
      for (std::size_t i = 0; i < 4; ++i) {
        const auto found = fitted.find(weights.index[i]);
        if (found != fitted.end()) at.emplace_back(found->second, weights.w[i]);
      }
      for (const auto& [i, w] : at) {
        independent += w * w * out[i];
        for (const auto& [j, v] : at) correlated += w * v * r(i, j);
      }
    }
    if (!(correlated > independent)) continue;  // no parameter is said to be known better than it is
    for (const auto& [index, i] : fitted) out[i] *= correlated / independent;
  }
  return out;
}

/// To three digits.
double rounded(double value) { return parse_si(fmt::format("{:.3g}", value), unit::si).value_or(value); }

}  // namespace

CovarianceFactor covariance_factor(const Fit& fit, const Unknowns& fitted, const Robot& robot,
                                   const std::vector<Observation>& rows) {
  const VectorXd units = units_of(fitted, fit.estimate.set);
  const Parts parts = parts_of(fitted, fit.estimate.set);
  const auto count = static_cast<Index>(fitted.count());
  if (count <= exact_parameters || parts.curves.empty())
    return {names_of(fitted), units.asDiagonal() * Llt(fit.covariance).lower()};

  // [C_oo C_oc; C_co C_cc] = [L 0; B 1] [1 0; 0 R] [L 0; B 1]^T with B^T = L^-1 C_oc
  const auto others = static_cast<Index>(parts.others.size());
  MatrixXd lower(others, others);
  MatrixXd below(others, static_cast<Index>(parts.curves.size()));
  MatrixXd r = fit.covariance(parts.curves, parts.curves);
  if (others > 0) {
    lower = Llt(fit.covariance(parts.others, parts.others)).lower();
    below = fit.covariance(parts.others, parts.curves);
    solve_lower(lower, below);
    r -= gram(below);
  }
  const std::vector<Observation> poses = reference_poses(rows);
  const MatrixXd columns = pivoted_columns(r, share_of_variance(fit, fitted, robot, poses, parts.curves),
                                           static_cast<double>(poses.size()));
  r -= product(columns, columns.transpose());
  const VectorXd variances = independent_variances(r, parts, fit.estimate.set);

  CovarianceFactor out;
  out.parameters = names_of(fitted);
  out.factor = MatrixXd::Zero(count, others + columns.cols());
  out.own = out.scale = VectorXd::Zero(count);
  for (Index k = 0; k < others; ++k)
    out.factor.row(parts.others[static_cast<std::size_t>(k)]).head(others) = lower.row(k);
  for (Index k = 0; k < columns.rows(); ++k) {
    const Index i = parts.curves[static_cast<std::size_t>(k)];
    out.factor.row(i).head(others) = below.col(k).transpose();
    out.factor.row(i).tail(columns.cols()) = columns.row(k);
    out.own[i] = std::sqrt(variances[k]);
  }
  out.factor = units.asDiagonal() * out.factor;
  out.own = out.own.cwiseProduct(units);
  for (const Index i : parts.curves) {
    const double sigma = std::sqrt(std::max(0.0, fit.covariance(i, i))) * units[i];
    out.scale[i] = rounded(sigma / 1000);
    if (!(out.scale[i] > 0)) continue;
    for (double& number : out.factor.row(i)) number = std::round(number / out.scale[i]) * out.scale[i];
    if (out.own[i] < out.scale[i] / 2) out.own[i] = 0;
  }
  return out;
}

}  // namespace flexcomp::host
