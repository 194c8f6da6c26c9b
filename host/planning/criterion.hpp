// SPDX-License-Identifier: Apache-2.0
/// \file
/// Optimality criteria of a set of poses (Chen et al. 2019, Eq. 30-33), with low-rank updates.
///
/// M = HᵀH over the set, H whitened and scaled by fixed units. With L parameters and n poses
///   O1 = det(M)^(1/2L) / √n                 (Borm and Menq: geometric mean of the singular values of H, per √pose)
///   Omin, expected = tr(M⁻¹)                (mean over the noise of the squared errors in units; Eq. 30 needs the truth)
///   fitness = Omin, expected / O1           (Eq. 33; smaller is better)
/// Equations (M43) to (M46). Where the frames are fitted too, M is its Schur complement without them, (M45).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "planning/pose_information.hpp"

namespace flexcomp::host {

/// Objective of a search, to be minimised.
enum class Goal {
  dual,       ///< fitness: Omin, expected / O1
  d_optimal,  ///< 1 / O1 alone, the objective of DETMAX
};

/// Trace and determinant from which every criterion is computed, of the parameters (frames projected out).
struct Figures {
  double trace = 0;    ///< of M⁻¹
  double log_det = 0;  ///< of M
};

/// Criterion of a set of `poses` poses for `parameters` unknowns.
struct Criterion {
  Eigen::Index parameters = 0;
  double poses = 0;
  Goal goal = Goal::dual;

  double o1(const Figures& f) const;         ///< observability index O1, (M43)
  double fitness(const Figures& f) const;    ///< Omin, expected / O1, (M46)
  double log_score(const Figures& f) const;  ///< logarithm of the objective
};

/// Information matrix M and its inverse by rank-r updates; refactorised from M before rounding accumulates.
class Information {
 public:
  /// Starts from `prior` on the diagonal (1/σ² in units), with which M is invertible for any number of poses.
  Information(Eigen::Index nuisance, Eigen::Index parameters, double prior);

  /// Sets M (without the prior) and factorises it.
  void assign(const Eigen::MatrixXd& m);
  void add(const Block& h) { update(h, 1); }
  void remove(const Block& h) { update(h, -1); }

  const Figures& figures() const { return figures_; }
  const Eigen::MatrixXd& matrix() const { return m_; }  ///< with the prior
  const Eigen::MatrixXd& inverse() const { return v_; }
  Eigen::Index unknowns() const { return m_.rows(); }
  Eigen::Index nuisance() const { return v_nuisance_.rows(); }
  Eigen::Index parameters() const { return unknowns() - nuisance(); }

  /// Trace and determinant of M + HHᵀ; M stays.
  Figures with(const Block& h) const;
  /// The same for many blocks of `rows` columns side by side.
  void with_each(const Eigen::MatrixXd& blocks, Eigen::Index rows, std::vector<Figures>& out) const;

  /// Derivative of the log score with respect to M (frames included): d log score = Σ gradient ∘ dM.
  Eigen::MatrixXd gradient(const Criterion& criterion) const;

 private:
  void update(const Block& h, double sign);
  void refresh();
  template <int R, class H, class VH>
  Figures changed(const H& h, const VH& vh) const;

  double prior_ = 0;
  Eigen::MatrixXd m_;
  Eigen::MatrixXd v_;           ///< M⁻¹
  Eigen::MatrixXd v_nuisance_;  ///< inverse of the frames' own block of M
  Figures figures_;
  int updates_ = 0;  ///< since the last refresh
};

/// Σ HHᵀ of blocks.
Eigen::MatrixXd sum_of_squares(const std::vector<Block>& blocks, Eigen::Index unknowns);

/// Trace and determinant of a set by QR decomposition of H, without prior and normal equations; full_rank is
/// false where H does not have full column rank to 1e-10.
struct ExactFigures {
  bool full_rank = false;
  Figures figures;
  Eigen::VectorXd sigma;  ///< standard deviation of each parameter, in units
};
ExactFigures exact_figures(const std::vector<Block>& blocks, Eigen::Index nuisance);

}  // namespace flexcomp::host
