// SPDX-License-Identifier: Apache-2.0
/// \file
/// A model fitted to the rows, as a diagnosis starts from.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_FITTED_MODEL_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_FITTED_MODEL_HPP

#include <cstdint>
#include <vector>

#include "identification/estimator.hpp"
#include "model/calibration.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// A fitted model and the unknowns that these rows determine (docs/model.md, M33).
struct FittedModel {
  Fit fit;
  Unknowns fitted;
};

/// Fits a calibration's own parameters again. What it was given and did not fit stays fixed; an effect `unnamed` too, so
/// that its cause is searched anew.
FittedModel fit_calibration(const Calibration& calibration, const Robot& robot,
                            const std::vector<Observation>& rows, std::uint64_t seed);

}  // namespace flexcomp::host

#endif
