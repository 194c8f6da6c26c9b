// SPDX-License-Identifier: Apache-2.0
/// \file
/// What a calibration file says, for a page.
#ifndef FLEXCOMP_HOST_REPORT_PARAMETERS_HPP
#define FLEXCOMP_HOST_REPORT_PARAMETERS_HPP

#include "model/calibration.hpp"
#include "model/robot.hpp"
#include "report/page.hpp"

namespace flexcomp::host {

/// Appends the parameters and the fitted frame parameters with their uncertainty, and what could not be told apart.
void add_parameters(Page& page, const Calibration& calibration, const Robot& robot);

}  // namespace flexcomp::host

#endif
