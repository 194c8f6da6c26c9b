// SPDX-License-Identifier: Apache-2.0
#include "identification/identifiability.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <random>

#include "linalg/decompositions.hpp"
#include "model/effects/descriptor.hpp"

namespace flexcomp::host {

Eigen::MatrixXd triangular_factor(const Eigen::MatrixXd& matrix) {
  if (matrix.rows() <= matrix.cols()) return matrix;
  return upper_factor(matrix);
}

Elimination eliminate(const Eigen::MatrixXd& all_rows, const std::vector<std::size_t>& order,
                      double tolerance) {
  Elimination out;
  const Eigen::MatrixXd matrix = triangular_factor(all_rows);
  Eigen::MatrixXd basis(matrix.rows(), static_cast<Eigen::Index>(order.size()));
  Eigen::Index rank = 0;
  std::vector<std::size_t> kept_in_order;
  std::vector<std::size_t> dependent;
  double largest = 0;
  for (const std::size_t c : order)
    largest = std::max(largest, matrix.col(static_cast<Eigen::Index>(c)).norm());
  for (const std::size_t c : order) {
    Eigen::VectorXd column = matrix.col(static_cast<Eigen::Index>(c));
    const double norm = column.norm();
    // Fixed units give columns of similar size: a column 1e-12 times as large is rounding.
    if (!(norm > 1e-12 * largest)) {
      out.dependent.push_back({c, {}});
      continue;
    }
    column /= norm;
    for (int pass = 0; pass < 2; ++pass) {  // twice is enough (Kahan, Parlett)
      column -= basis.leftCols(rank) * (basis.leftCols(rank).transpose() * column);
    }
    if (rank < matrix.rows() && column.norm() > tolerance) {
      basis.col(rank++) = column.normalized();
      kept_in_order.push_back(c);
    } else {
      dependent.push_back(c);
    }
  }
  if (!dependent.empty()) {
    Eigen::MatrixXd kept(matrix.rows(), rank);
    for (Eigen::Index k = 0; k < rank; ++k) {
      kept.col(k) =
          matrix.col(static_cast<Eigen::Index>(kept_in_order[static_cast<std::size_t>(k)])).normalized();
    }
    const PivotedQr qr(kept);
    for (const std::size_t c : dependent) {
      const Eigen::VectorXd share = qr.solve(matrix.col(static_cast<Eigen::Index>(c)).normalized());
      DependentColumn entry{c, {}};
      const double most = share.cwiseAbs().maxCoeff();
      for (Eigen::Index k = 0; k < rank; ++k) {
        if (std::abs(share[k]) > 1e-3 * most)
          entry.with.push_back(kept_in_order[static_cast<std::size_t>(k)]);
      }
      out.dependent.push_back(entry);
    }
  }
  out.kept = kept_in_order;
  std::ranges::sort(out.kept);
  std::ranges::sort(out.dependent, {}, &DependentColumn::column);
  return out;
}

std::vector<std::size_t> elimination_order(const Unknowns& unknowns, const TermSet& set) {
  const std::size_t frames = unknowns.frames.size();
  const auto rank = [&](std::size_t column) -> int {
    if (column < frames) return 0;
    const Term<double>& term = set.terms[unknowns.parameters[column - frames].terms.front()];
    if (term.effect == Effect::geometric) {
      if (term.place.body != body::base) return 2;
      if (term.place.slot == slot::z) return 10;
      return term.place.slot == slot::rz ? 11 : 1;
    }
    const auto effect_rank = descriptor(term.effect).elimination_rank;
    return effect_rank == nullptr ? 4 : effect_rank(term.place);
  };
  std::vector<std::size_t> order(unknowns.count());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });
  return order;
}

std::vector<Observation> random_observations(const Robot& robot, const std::vector<Observation>& like,
                                             std::size_t count, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::vector<Observation> rows(count);
  for (std::size_t k = 0; k < count; ++k) {
    rows[k] = like[k % like.size()];
    rows[k].line = 0;
    for (std::size_t i = 0; i < joint_count; ++i) {
      const JointLimits& limits = robot.nominal.limits[i];
      rows[k].q_rad[i] = std::uniform_real_distribution<double>(limits.min_rad, limits.max_rad)(engine);
    }
  }
  return rows;
}

}  // namespace flexcomp::host
