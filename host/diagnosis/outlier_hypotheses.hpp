// SPDX-License-Identifier: Apache-2.0
/// \file
/// Outliers or structure (D13): rows that do not fit may be mistakes, or the only rows that show a local fault or a slip.
#pragma once

#include <vector>

#include "diagnosis/gap_system.hpp"
#include "diagnosis/refit.hpp"
#include "diagnosis/subset_search.hpp"

namespace flexcomp::host {

/// Chi-square that a row costs at most: it is then an outlier (99.9 % of the chi-square of six numbers, and what it takes
/// to say so of one row among hundreds).
constexpr double outlier_price = 40;

/// Cost of a solution over all rows (D13): chi-square per row, bounded by outlier_price, and that of the parameters.
double cost_with_outliers(const Robot& robot, const std::vector<Observation>& rows, const Refit& refit,
                          const Scored& solution, double noise_scale2);

/// Sets of rows to search instead, if there are outliers: all rows (where they are few), and those in full with the
/// outliers that a rotation of one joint alone explains, of the joint that explains most.
/// \param everything  system of all rows at the refit
std::vector<std::vector<bool>> outlier_alternatives(const Robot& robot, const std::vector<Observation>& rows,
                                                    const Refit& refit, const GapSystem& everything);

}  // namespace flexcomp::host
