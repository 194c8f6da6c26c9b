// SPDX-License-Identifier: Apache-2.0
/// \file
/// Errors before and after and a whole identification as JSON.
#pragma once

#include <vector>

#include "identification/identify.hpp"
#include "json.hpp"

namespace flexcomp::host {

/// {"mean_mm", "rms_mm", "max_mm", "mean_deg"} (the last only where orientations were measured).
Json to_json(const ErrorStatistics& s);

/// {"nominal_frames": {…}, "fitted_frames": {…}}
Json to_json(const Before& before);

/// \param rows  those that were fitted: outliers are given by their lines
Json to_json(const Identification& r, const std::vector<Observation>& rows);

}  // namespace flexcomp::host
