// SPDX-License-Identifier: Apache-2.0
/// \file
/// Parts of a page from files of earlier runs.
#pragma once

#include <string>

#include "report/page.hpp"

namespace flexcomp::host {

/// Two files with q1_deg … q6_deg, dx_mm dy_mm dz_mm and, where known, distance_deg, payload_kg, temp_c, time_s.
/// \throws InputError  a column that is missing, files of different length
PagePoses errors_before_and_after(const std::string& title, const std::string& before_csv,
                                  const std::string& after_csv, double noise_floor_m);

/// The JSON of an identification or a validation. \throws InputError  no_result_file
PageResult stored_result(const std::string& title, const std::string& path);

}  // namespace flexcomp::host
