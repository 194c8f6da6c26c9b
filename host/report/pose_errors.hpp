// SPDX-License-Identifier: Apache-2.0
/// \file
/// Errors of a set of poses as the lists of numbers that plots, tables and the script of a page take.
#ifndef FLEXCOMP_HOST_REPORT_POSE_ERRORS_HPP
#define FLEXCOMP_HOST_REPORT_POSE_ERRORS_HPP

#include <array>
#include <string>
#include <vector>

#include "report/page.hpp"
#include "report/plots.hpp"

namespace flexcomp::host {

double length(const std::array<double, 3>& v);

/// Lengths of the position errors, mm.
ErrorPairs position_errors(const PagePoses& set);
/// Component 0 … 2 of the position errors, mm.
ErrorPairs component_errors(const PagePoses& set, std::size_t axis);
/// Angles of the orientation errors, deg; empty where one is unknown.
ErrorPairs orientation_errors(const PagePoses& set);

struct SampleStatistics {
  double mean = 0, rms = 0, median = 0, max = 0;
};
SampleStatistics statistics_of(std::vector<double> values);
/// The value below which nine of ten lie; 0 of none.
double ninth_decile(std::vector<double> values);

/// Seconds since the first row: a clock counts from 1970 or from its own start, and neither says anything.
PageCovariate time_covariate(std::vector<double> time_s);

}  // namespace flexcomp::host

#endif
