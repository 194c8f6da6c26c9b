// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/cross_validation.hpp"

#include <Eigen/Dense>
#include <array>
#include <map>
#include <optional>
#include <utility>

#include "linalg/blas.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {

namespace {

/// Least 1 - h, h the leverage of a pose in one direction, at which the other poses predict it there.
constexpr double decides_alone = 1e-9;

/// Prior precision of the model's own parameters: as good as none.
constexpr double free_precision = 1e-12;

}  // namespace

LeftOutPoses::LeftOutPoses(const std::vector<Observation>& rows) {
  std::map<std::array<double, joint_count>, std::size_t> known;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto [at, fresh] = known.emplace(rows[k].q_rad, poses_.size());
    if (fresh) poses_.emplace_back();
    poses_[at->second].push_back(k);
  }
}

double LeftOutPoses::chi2_per_number(const SubsetSearch& search, const Scored& solution,
                                     const ChosenColumns& besides) const {
  const GapSystem& system = search.system();
  const Eigen::Index own = system.nuisance.cols();
  const ChosenColumns added = search.columns_of(solution.blocks);
  const Eigen::Index named = added.columns.cols();
  const Eigen::Index count = own + named + besides.columns.cols();
  Eigen::MatrixXd all(system.columns.rows(), count);
  all.leftCols(own) = system.nuisance;
  all.middleCols(own, named) = added.columns;
  if (besides.columns.cols() > 0) all.rightCols(besides.columns.cols()) = besides.columns;
  Eigen::VectorXd precision = Eigen::VectorXd::Constant(count, free_precision);
  precision.segment(own, named) = added.precision;
  precision.tail(besides.precision.size()) = besides.precision;
  Eigen::MatrixXd normal = gram(all);
  normal.diagonal() += precision;
  Eigen::MatrixXd right = all.transpose() * system.residual;
  if (!factor_in_place(normal)) return system.residual.squaredNorm() / system.numbers;
  solve_lower(normal, right);
  orthonormalise(normal, all);  // all all^T is now the matrix that takes measured numbers to their fit
  const Eigen::VectorXd fitted = all * right.col(0);
  double sum = 0;
  for (const std::vector<std::size_t>& pose : poses_) {
    const Eigen::Index size = 6 * static_cast<Eigen::Index>(pose.size());
    Eigen::MatrixXd part(size, count);
    Eigen::VectorXd left(size);
    Eigen::VectorXd measured(size);
    for (std::size_t k = 0; k < pose.size(); ++k) {
      const Eigen::Index from = 6 * static_cast<Eigen::Index>(pose[k]);
      const Eigen::Index to = 6 * static_cast<Eigen::Index>(k);
      part.middleRows<6>(to) = all.middleRows<6>(from);
      measured.segment<6>(to) = system.residual.segment<6>(from);
      left.segment<6>(to) = measured.segment<6>(to) - fitted.segment<6>(from);
    }
    const SymmetricEigen eigen = symmetric_eigen(part * part.transpose());
    const Eigen::VectorXd along = eigen.vectors.transpose() * left;
    const Eigen::VectorXd whole = eigen.vectors.transpose() * measured;
    for (Eigen::Index k = 0; k < size; ++k) {
      const double others = 1 - eigen.values[k];
      const double error = others > decides_alone ? along[k] / others : whole[k];
      sum += error * error;
    }
  }
  return sum / system.numbers;
}

Scored prune_by_cross_validation(const SubsetSearch& search, const LeftOutPoses& left_out,
                                 std::size_t most_effects, Scored best) {
  const std::vector<Block>& blocks = search.system().blocks;
  // Of a function that block alone, of an effect all its blocks.
  const auto goes_with = [&](std::size_t b, std::size_t other) {
    return other == b || (!blocks[b].is_function() && same_name(blocks[other].id, blocks[b].id));
  };
  std::vector<bool> allowed(blocks.size(), true);
  for (std::size_t round = 0; round < 2 * most_effects && !best.blocks.empty(); ++round) {
    double least = left_out.chi2_per_number(search, best);
    std::optional<std::size_t> idle;
    Scored without_it;
    for (const std::size_t b : best.blocks) {
      // Of the few poses in a local fault each one left out takes most of it away.
      if (blocks[b].is_local()) continue;
      Scored less =
          search.score(without_if(best.blocks, [&](std::size_t other) { return goes_with(b, other); }));
      const double chi2 = left_out.chi2_per_number(search, less);
      if (chi2 > least) continue;
      least = chi2;
      idle = b;
      without_it = std::move(less);
    }
    if (!idle) break;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      if (goes_with(*idle, b)) allowed[b] = false;
    }
    best = round < most_effects ? search.best(most_effects, {without_it.blocks}, allowed) : without_it;
  }
  return best;
}

}  // namespace flexcomp::host
