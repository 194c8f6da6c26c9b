// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/residual_analysis.hpp"

#include <Eigen/Dense>
#include <algorithm>

#include "distributions.hpp"
#include "linalg/blas.hpp"

namespace flexcomp::host {

ResidualAnalysis residual_after(const SubsetSearch& search, const Scored& solution) {
  const GapSystem& system = search.system();
  ResidualAnalysis out = residual_after(system);
  out.noise_scale2 = search.noise_scale2();
  auto [added, precision] = search.columns_of(solution.blocks);
  if (added.cols() == 0) return out;
  for (Eigen::Index c = 0; c < added.cols(); ++c) out.residual -= added.col(c) * solution.solution[c];
  // basis basis^T is the matrix that takes the residuals to their fit; with priors its trace counts what they leave free.
  Eigen::MatrixXd normal = gram(added);
  normal.diagonal() += precision;
  if (!factor_in_place(normal)) return out;
  orthonormalise(normal, added);
  out.fitted_numbers += added.squaredNorm();
  out.basis.resize(added.rows(), system.nuisance.cols() + added.cols());
  out.basis << system.nuisance, added;
  return out;
}

ResidualAnalysis residual_after(const GapSystem& system) {
  return {system.residual, system.nuisance, static_cast<double>(system.nuisance.cols()), 1};
}

namespace {

PlaceProjection project(const GapSystem& system, const ResidualAnalysis& left,
                        const Eigen::VectorXd& column) {
  const Eigen::Index n = static_cast<Eigen::Index>(system.rows);
  PlaceProjection s{Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::MatrixXd(left.basis.cols(), n)};
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto u = column.segment<6>(6 * k);
    s.square[k] = u.squaredNorm();
    s.product[k] = u.dot(left.residual.segment<6>(6 * k));
    s.basis.col(k).noalias() = left.basis.middleRows<6>(6 * k).transpose() * u;
  }
  return s;
}

}  // namespace

std::vector<PlaceProjection> joint_projections(const GapSystem& system, const ResidualAnalysis& left) {
  std::vector<PlaceProjection> joints;
  for (std::uint8_t j = 1; j <= joint_count; ++j)
    joints.push_back(project(system, left, place_column(system, {j, slot::theta})));
  return joints;
}

std::vector<PlaceShare> place_shares(const GapSystem& system, const ResidualAnalysis& left) {
  std::vector<PlaceShare> shares;
  const double dof = system.numbers - left.fitted_numbers;
  const double beyond = left.chi2() - dof;
  for (const PlaceColumn& place : system.places) {
    const PlaceProjection s = project(system, left, place.column);
    double found = 0;
    double expected = 0;
    double square = 0;
    for (Eigen::Index k = 0; k < s.square.size(); ++k) {
      if (!(s.square[k] > 0)) continue;
      const double freedom = std::max(0.0, 1 - s.basis.col(k).squaredNorm() / s.square[k]);
      if (freedom < 1e-6) continue;
      found += s.product[k] * s.product[k] / s.square[k] / left.noise_scale2;
      expected += freedom;
      square += freedom * freedom;
    }
    if (!(expected > 0.5)) continue;
    // Satterthwaite: a multiple of a chi-square with the same mean and variance.
    const double factor = square / expected;
    PlaceShare share;
    share.place = place.place;
    share.p_value = chi2_above(found / factor, expected / factor);
    share.explains = beyond > 0 ? std::clamp((found - expected) / beyond, 0.0, 1.0) : 0;
    shares.push_back(share);
  }
  std::ranges::stable_sort(shares, std::ranges::greater(), &PlaceShare::explains);
  return shares;
}

}  // namespace flexcomp::host
