// SPDX-License-Identifier: Apache-2.0
/// \file
/// Validates a calibration on rows that were not fitted.
#pragma once

#include <string>
#include <vector>

#include "identification/identify.hpp"

namespace flexcomp::host {

struct Validation {
  Before before;
  ErrorStatistics after;
  std::vector<RowResidual> residuals;  ///< after, per row
  std::vector<RowResidual> nominal;    ///< before, in fitted frames where there are any, per row
  /// Chi-square after, Eq. (M42), with measured_numbers() degrees of freedom: nothing is fitted. The covariance
  /// is that of the rows' noise plus, where the calibration has it, that of the estimate: even with a complete
  /// model, parameters from 14 poses err by more than the noise at other poses.
  double chi2 = 0;
  double degrees_of_freedom = 0;
  std::vector<std::string> doubts;  ///< why the calibration must not be relied on; empty where it may be

  double chi2_per_dof() const { return degrees_of_freedom > 0 ? chi2 / degrees_of_freedom : 0; }
};

/// Computes errors before and after and chi-square, in the frames of the calibration (F = E = 1 where it has none).
Validation validate(const Robot& robot, const Calibration& calibration, const std::vector<Observation>& rows,
                    const std::string& source);

/// Errors of an arm that was driven with corrected commands: against the nominal model at the uncorrected
/// commands, in the frames of the calibration. Nothing is fitted.
ErrorStatistics errors_of_corrected(const Robot& robot, const Calibration& calibration,
                                    const std::vector<Observation>& rows);

/// Residuals of rows against a calibration, in its frames.
std::vector<RowResidual> residuals_with(const Robot& robot, const Calibration& calibration,
                                        const std::vector<Observation>& rows);

}  // namespace flexcomp::host
