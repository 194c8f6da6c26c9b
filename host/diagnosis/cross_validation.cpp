// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/cross_validation.hpp"

#include <Eigen/Dense>
#include <array>
#include <map>

#include "linalg/blas.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {

namespace {

/// A pose that alone decides a direction (what the others leave free of it, as a share) predicts nothing of itself there.
constexpr double decides_alone = 1e-9;

/// Hardly anything: what the model moves has no prior.
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

double LeftOutPoses::chi2_per_number(const SubsetSearch& search, const Scored& solution) const {
  const GapSystem& system = search.system();
  const Eigen::Index own = system.nuisance.cols();
  Eigen::Index count = own;
  for (const std::size_t b : solution.blocks)
    count += static_cast<Eigen::Index>(system.blocks[b].columns.size());
  Eigen::MatrixXd all(system.columns.rows(), count);
  all.leftCols(own) = system.nuisance;
  Eigen::VectorXd precision = Eigen::VectorXd::Constant(count, free_precision);
  Eigen::Index at = own;
  for (const std::size_t b : solution.blocks) {
    for (const Eigen::Index c : system.blocks[b].columns) {
      precision[at] = search.noise_scale2() * search.precision_of(system.blocks[b], c);
      all.col(at++) = system.columns.col(c);
    }
  }
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

}  // namespace flexcomp::host
