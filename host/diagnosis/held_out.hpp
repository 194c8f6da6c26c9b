// SPDX-License-Identifier: Apache-2.0
/// \file
/// Rows that were kept out of a diagnosis: whether the gap shrinks there too.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/result.hpp"
#include "measurement/measured_data.hpp"

namespace flexcomp::host {

struct HeldOut {
  std::size_t rows = 0;
  ErrorStatistics before;    ///< with Diagnosis::before, in its frames
  ErrorStatistics after;     ///< with Diagnosis::after
  double noise_floor_m = 0;  ///< of these rows
};

/// sqrt(mean over rows of the trace of the position's covariance), m.
double noise_floor_m(const std::vector<Observation>& rows);

/// Errors of rows that were not fitted.
/// \param force  go on where they look like another instrument frame
/// \throws InputError  rows that are off by 100 times what the fitted ones are: measured in another frame
HeldOut held_out(const Robot& robot, const Diagnosis& d, const std::vector<Observation>& rows,
                 const std::string& source, bool force);

/// \throws InputError  the same file, or a row of `other` that is one of `fitted`: what was fitted proves nothing
void refuse_the_fitted(const MeasuredData& fitted, const MeasuredData& other);

/// Context columns that the fitted data have and these do not: there the robot file's defaults stand.
std::vector<std::string> missing_columns(const MeasuredData& fitted, const MeasuredData& other);

}  // namespace flexcomp::host
