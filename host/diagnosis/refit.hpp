// SPDX-License-Identifier: Apache-2.0
/// \file
/// The whole model with what was found, fitted anew: nothing is frozen.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_REFIT_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_REFIT_HPP

#include <vector>

#include "diagnosis/effect_search.hpp"
#include "identification/estimator.hpp"
#include "model/calibration.hpp"

namespace flexcomp::host {

struct Refit {
  Fit fit;  ///< of the start's parameters and the effects'
  Unknowns fitted;
  Calibration calibration;
  std::size_t start_terms = 0;  ///< the first so many terms of the set are the start's
};

Refit refit_with(const Robot& robot, const std::vector<Observation>& rows, const Estimate& start,
                 const Unknowns& fitted, const Explanation& found);

/// Coefficients, and how far the effect moves the measured point beyond what the model's other parts would take up.
/// \param nuisance  orthonormal basis of these, whitened as the rows are
void describe(FoundEffect& effect, const Refit& refit, const Robot& robot,
              const std::vector<Observation>& rows, const Eigen::MatrixXd& nuisance);

}  // namespace flexcomp::host

#endif
