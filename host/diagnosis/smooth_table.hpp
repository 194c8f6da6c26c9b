// SPDX-License-Identifier: Apache-2.0
/// \file
/// An unnamed function as a table that the core reads (docs/model.md, M7).
#ifndef FLEXCOMP_HOST_DIAGNOSIS_SMOOTH_TABLE_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_SMOOTH_TABLE_HPP

#include <vector>

#include "diagnosis/hypothesis.hpp"
#include "model/effects.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// Adds the effect `unnamed` with the bilinear table that is closest to the function (least squares). Nothing is added
/// where the function follows the order of measurement, which no controller has.
void add_smooth_table(const Hypothesis& hypothesis, const std::vector<Variable>& variables,
                      const Robot& robot, ParametricModel& model);

}  // namespace flexcomp::host

#endif
