// SPDX-License-Identifier: Apache-2.0
/// \file
/// What an explanation is worth on poses that it has not seen.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_CROSS_VALIDATION_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_CROSS_VALIDATION_HPP

#include <cstddef>
#include <vector>

#include "diagnosis/subset_search.hpp"
#include "measurement/observation.hpp"

namespace flexcomp::host {

/// Rows by pose: those with the same joint readings are left out together.
class LeftOutPoses {
 public:
  explicit LeftOutPoses(const std::vector<Observation>& rows);

  /// Chi-square per measured number on poses that were left out, one after the other: the model's own parameters and the
  /// blocks are fitted to all the others (in closed form, the leave-one-out residuals of ridge regression: Allen, PRESS,
  /// 1974; in blocks Hastie, Tibshirani, Friedman, Elements of Statistical Learning, 7.10).
  double chi2_per_number(const SubsetSearch& search, const Scored& solution) const;

 private:
  std::vector<std::vector<std::size_t>> poses_;
};

}  // namespace flexcomp::host

#endif
