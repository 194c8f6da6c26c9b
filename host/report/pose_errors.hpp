// SPDX-License-Identifier: Apache-2.0
/// \file
/// Errors of a set of poses as the lists of numbers that plots, tables and the script of a page take, and which of very
/// many poses are drawn.
#pragma once

#include <array>
#include <cstddef>
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

/// All, where they are at most `limit`. Else as many as that: the twentieth part with the largest errors after, as many
/// with the largest before, and of the others every n-th. Ascending.
std::vector<std::size_t> shown_poses(const std::vector<PagePose>& poses, std::size_t limit);

/// The same by the sizes themselves: a twentieth part by each list.
/// \param sizes  as many numbers each
std::vector<std::size_t> shown_rows(const std::vector<const std::vector<double>*>& sizes, std::size_t limit);

/// Which of `count` things in a row are drawn: all, or `most` evenly spaced ones.
std::vector<std::size_t> evenly_spaced(std::size_t count, std::size_t most);

}  // namespace flexcomp::host
