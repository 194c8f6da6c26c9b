// SPDX-License-Identifier: Apache-2.0
/// \file
/// Cross-validation of a solution: prediction of left-out poses in closed form (D12), and removal of what does not help.
#pragma once

#include <cstddef>
#include <vector>

#include "diagnosis/subset_search.hpp"
#include "measurement/observation.hpp"

namespace flexcomp::host {

/// Leave-one-pose-out: rows with the same joint readings are left out together.
class LeftOutPoses {
 public:
  explicit LeftOutPoses(const std::vector<Observation>& rows);

  /// Chi-square per measured number on poses that were left out, one after the other (D12): leave-one-out residuals of ridge
  /// regression (Allen, PRESS, 1974; in blocks Hastie, Tibshirani, Friedman, Elements of Statistical Learning, 7.10).
  /// \param besides  further columns, as columns_of() has them
  double chi2_per_number(const SubsetSearch& search, const Scored& solution,
                         const ChosenColumns& besides = {}) const;

 private:
  std::vector<std::vector<std::size_t>> poses_;
};

/// Removes the effects without which left-out poses are predicted better, one at a time; others may come in their place.
/// Local faults are excepted.
Scored prune_by_cross_validation(const SubsetSearch& search, const LeftOutPoses& left_out,
                                 std::size_t most_effects, Scored best);

}  // namespace flexcomp::host
