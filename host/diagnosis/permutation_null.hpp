// SPDX-License-Identifier: Apache-2.0
/// \file
/// Null distribution of the largest gain in the whole catalogue, by permutation of the poses (D17).
#ifndef FLEXCOMP_HOST_DIAGNOSIS_PERMUTATION_NULL_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_PERMUTATION_NULL_HPP

#include <cstdint>
#include <vector>

#include "diagnosis/residual_analysis.hpp"

namespace flexcomp::host {

class PermutationNull {
 public:
  /// Permutes the poses of a residual, freely and in runs of consecutive ones in turn, and keeps of each permutation the
  /// largest gain of one block alone.
  PermutationNull(const SubsetSearch& search, const ResidualAnalysis& left, std::uint64_t seed);

  /// Probability that chance gains as much anywhere in the catalogue; beyond the permutations by the Gumbel distribution
  /// of their maxima (moments). 1 where the rows are too few.
  double p_value(double gain) const;

 private:
  std::vector<double> maxima_;
};

}  // namespace flexcomp::host

#endif
