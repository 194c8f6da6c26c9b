// SPDX-License-Identifier: Apache-2.0
/// \file
/// Residual of a solution (D5), its projection onto the places of the chain, and their shares of the misfit (D6).
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <vector>

#include "diagnosis/gap_system.hpp"
#include "diagnosis/subset_search.hpp"

namespace flexcomp::host {

/// Residual of a solution and the projector that made it.
struct ResidualAnalysis {
  Eigen::VectorXd residual;   ///< whitened
  Eigen::MatrixXd basis;      ///< of nuisance and blocks: basis basis^T takes residuals to their fit
  double fitted_numbers = 0;  ///< trace of that
  double noise_scale2 = 1;
  double chi2() const { return residual.squaredNorm() / noise_scale2; }
};

ResidualAnalysis residual_after(const SubsetSearch& search, const Scored& solution);
/// Of no block, with the declared noise.
ResidualAnalysis residual_after(const GapSystem& system);

/// Residual projected onto the column u of one place, row by row: of each scan's normal equations the part per row.
struct PlaceProjection {
  Eigen::VectorXd square;   ///< |u|^2
  Eigen::VectorXd product;  ///< u . r
  Eigen::MatrixXd basis;    ///< one column per row: basis^T u
};
/// Of the rotations of all joints, joint 1 first.
std::vector<PlaceProjection> joint_projections(const GapSystem& system, const ResidualAnalysis& left);

/// Shares of all places, largest first: a motion of the place alone, free from pose to pose (D6). p from the chi-square
/// distribution with the moments that the noise gives (Satterthwaite).
std::vector<PlaceShare> place_shares(const GapSystem& system, const ResidualAnalysis& left);

/// Sorts what a scan found by gain and keeps the best.
template <class Found>
void keep_best(std::vector<Found>& all, std::size_t most) {
  std::ranges::sort(all, std::ranges::greater(), &Found::gain);
  if (all.size() > most) all.resize(most);
}

}  // namespace flexcomp::host
