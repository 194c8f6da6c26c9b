// SPDX-License-Identifier: Apache-2.0
/// \file
/// Which blocks explain the misfit, and which could be exchanged without the data noticing.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_SUBSET_SEARCH_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_SUBSET_SEARCH_HPP

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "diagnosis/gap_system.hpp"

namespace flexcomp::host {

using Subset = std::vector<std::size_t>;  ///< indices of blocks

/// A subset, its value and its solution.
struct Scored {
  Subset blocks;
  /// What it takes from chi-square (over the noise scale) less what its parameters cost: 2 ln of the Bayes factor
  /// against no effect, by BIC or, of blocks with a prior, by the evidence.
  double gain = 0;
  double chi2_gain = 0;
  double parameters = 0;
  Eigen::VectorXd solution;  ///< coefficients in units, in the order of the blocks' columns
};

/// Gram matrix of a system and the best subsets in it.
class SubsetSearch {
 public:
  /// \param noise_scale2  variance of the whitened residual where the declared noise is right: 1
  SubsetSearch(const GapSystem& system, double noise_scale2);

  Scored score(const Subset& subset) const;

  /// Beam search over subsets of at most `largest` blocks, then exchanges and removals until none helps. `start` is one
  /// of the subsets to begin from, besides the empty one.
  Scored best(std::size_t largest, const std::vector<Subset>& starts = {},
              const std::vector<bool>& allowed = {}) const;

  /// Gain of every block when added to a subset (minus infinity where it must not be); gains of blocks of size k cost
  /// k ln n.
  std::vector<double> extensions(const Subset& subset) const;

  /// What the data know of a block's coefficients when those of others are free within their priors: information and
  /// right-hand side of its normal equations, its own prior left out.
  std::pair<Eigen::MatrixXd, Eigen::VectorXd> given(const Subset& others, std::size_t block) const;

  /// Gains of each block alone for other residuals (columns of `right`: columns' products with them).
  Eigen::VectorXd largest_single_gains(const Eigen::MatrixXd& residuals) const;

  /// May both stand in one set?
  bool compatible(std::size_t a, std::size_t b) const;

  /// Takes in blocks that were added to the system since.
  void extend();

  /// Prior precision of a coefficient, per square of its unit.
  double precision_of(const Block& block, Eigen::Index column) const;

  const GapSystem& system() const { return system_; }
  double noise_scale2() const { return scale2_; }
  double log_n() const { return log_n_; }
  /// Value with the margin taken off per effect: what the search maximises.
  double value(const Scored& s) const { return s.gain - margins(s.blocks); }
  double margins(const Subset& subset) const;

 private:
  const GapSystem& system_;
  double scale2_;
  double log_n_;
  double total_ = 0;         // chi-square of the whole misfit
  Eigen::MatrixXd gram_;     // over the scale
  Eigen::VectorXd product_;  // of the columns with the residual, over the scale
};

}  // namespace flexcomp::host

#endif
