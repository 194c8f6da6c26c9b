// SPDX-License-Identifier: Apache-2.0
/// \file
/// Refit of the nonlinear model with the selected hypotheses: nothing is fixed (docs/model.md, M34 to M40).
#pragma once

#include <vector>

#include "diagnosis/hypothesis.hpp"
#include "diagnosis/joint_curves.hpp"
#include "identification/estimator.hpp"
#include "model/calibration.hpp"

namespace flexcomp::host {

/// A fitted model and the unknowns that these rows determine (docs/model.md, M33).
struct FittedModel {
  Fit fit;
  Unknowns fitted;
};

/// Fits a calibration's own parameters again. What it was given and did not fit stays fixed; an effect `unnamed` too, so
/// that its cause is searched anew. Curves that were fitted are left out for the same reason.
FittedModel fit_calibration(const Calibration& given, const Robot& robot,
                            const std::vector<Observation>& rows, std::uint64_t seed);

/// Whether a calibration has curves that were fitted.
bool has_fitted_curves(const Calibration& calibration);

/// The start's parameters and the effects'.
struct Refit : FittedModel {
  Calibration calibration;
};

/// Fits the start's parameters and those of the hypotheses; unnamed functions enter as fixed tables.
/// \param declared  rows with the noise that was declared
/// \param curves  prior of the joints' curves, named or carried, and the noise (D19); null: named curves get a prior of their
///                own size (empirical Bayes, D16)
Refit refit_model(const Robot& robot, const std::vector<Observation>& declared, const FittedModel& start,
                  const SearchResult& found, const CurveMaximum* curves = nullptr);

}  // namespace flexcomp::host
