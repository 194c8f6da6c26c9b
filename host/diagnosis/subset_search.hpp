// SPDX-License-Identifier: Apache-2.0
/// \file
/// Selection of the blocks that explain a misfit: subsets scored by BIC and evidence (D2, D3), beam search (D4).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "diagnosis/gap_system.hpp"

namespace flexcomp::host {

using Subset = std::vector<std::size_t>;  ///< indices of blocks

/// The blocks of a subset that `drop` does not hold for.
template <class Predicate>
Subset without_if(const Subset& subset, Predicate drop) {
  Subset out;
  for (const std::size_t b : subset) {
    if (!drop(b)) out.push_back(b);
  }
  return out;
}
inline Subset without(const Subset& subset, std::size_t block) {
  return without_if(subset, [&](std::size_t b) { return b == block; });
}

/// A subset, its gain and its least-squares solution.
struct Scored {
  Subset blocks;
  double gain = 0;       ///< 2 ln of the Bayes factor against no effect, by BIC (D2) or evidence (D3)
  double chi2_gain = 0;  ///< reduction of chi-square, over the noise scale
  double parameters = 0;
  Eigen::VectorXd solution;  ///< coefficients in units, in the order of the blocks' columns
};

/// Columns of chosen blocks and the prior precision of their coefficients, in the metric of the whitened residual.
struct ChosenColumns {
  Eigen::MatrixXd columns;
  Eigen::VectorXd precision;
};

/// Gram matrix of a system and the best subsets in it.
class SubsetSearch {
 public:
  /// \param noise_scale2  variance of the whitened residual where the declared noise is right: 1
  SubsetSearch(const GapSystem& system, double noise_scale2);

  Scored score(const Subset& subset) const;

  /// Subset of at most `largest` blocks that maximises value() (D4): beam search, then exchanges and removals until none
  /// improves it. \param starts  subsets to begin from, besides the empty one \param allowed  per block; empty: all
  Scored best(std::size_t largest, const std::vector<Subset>& starts = {},
              const std::vector<bool>& allowed = {}) const;

  /// Gain of every block when added to a subset (minus infinity where it must not be); gains of blocks of size k cost
  /// k ln n.
  std::vector<double> extensions(const Subset& subset) const;

  /// Normal equations of a block, those of others eliminated (Schur complement): information and right-hand side, its own
  /// prior left out.
  std::pair<Eigen::MatrixXd, Eigen::VectorXd> given(const Subset& others, std::size_t block) const;

  /// Largest gain of one block alone, for each of other residuals (columns).
  Eigen::VectorXd largest_single_gains(const Eigen::MatrixXd& residuals) const;

  /// Whether both may be in one subset.
  bool compatible(std::size_t a, std::size_t b) const;

  /// Updates the Gram matrix after blocks were added to the system.
  void extend();

  /// Prior precision of a coefficient, per square of its unit.
  double precision_of(const Block& block, Eigen::Index column) const;

  ChosenColumns columns_of(const Subset& subset) const;

  const GapSystem& system() const { return system_; }
  double noise_scale2() const { return scale2_; }
  double log_n() const { return log_n_; }
  /// Objective of the search: gain less the margins (D4).
  double value(const Scored& s) const { return s.gain - margins(s.blocks); }
  double margins(const Subset& subset) const;

 private:
  struct Selected {
    std::vector<Eigen::Index> index;  // of columns
    Eigen::VectorXd precision;
  };
  Selected selected(const Subset& subset) const;
  Eigen::MatrixXd normal_matrix(const Selected& s) const;
  /// \param reduced  L^-1 of the Gram matrix's rows of the subset \param done  L^-1 of their right-hand side
  double gain_of_adding(const Block& block, const Eigen::MatrixXd& reduced,
                        const Eigen::MatrixXd& done) const;
  Scored beam_search(std::size_t largest, const std::vector<Subset>& starts,
                     const std::vector<bool>& allowed) const;
  Scored with_exchanges(Scored best, const std::vector<bool>& allowed) const;

  const GapSystem& system_;
  double scale2_;
  double log_n_;
  double total_ = 0;         // chi-square of the whole misfit
  Eigen::MatrixXd gram_;     // over the scale
  Eigen::VectorXd product_;  // of the columns with the residual, over the scale
};

}  // namespace flexcomp::host
