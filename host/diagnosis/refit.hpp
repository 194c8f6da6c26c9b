// SPDX-License-Identifier: Apache-2.0
/// \file
/// Refit of the nonlinear model with the selected hypotheses: nothing is fixed (docs/model.md, M34 to M40).
#ifndef FLEXCOMP_HOST_DIAGNOSIS_REFIT_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_REFIT_HPP

#include <vector>

#include "diagnosis/fitted_model.hpp"
#include "diagnosis/hypothesis.hpp"
#include "identification/estimator.hpp"
#include "model/calibration.hpp"

namespace flexcomp::host {

/// The start's parameters and the effects'.
struct Refit : FittedModel {
  Calibration calibration;
};

/// Fits the start's parameters and those of the hypotheses. Curves get a prior of their own size (empirical Bayes, D16);
/// unnamed functions enter as fixed tables.
Refit refit_model(const Robot& robot, const std::vector<Observation>& rows, const FittedModel& start,
                  const SearchResult& found);

}  // namespace flexcomp::host

#endif
