// SPDX-License-Identifier: Apache-2.0
/// \file
/// Forward model of a measurement, Eq. (M1) and (M29).
#pragma once

#include <array>

#include "flexcomp/linear.hpp"
#include "flexcomp/robot.hpp"
#include "model/calibration.hpp"
#include "model/host_model.hpp"

namespace flexcomp::host {

/// Measured point or frame in the frame of the instrument: F B A1 … A6 Tool T E, with T the translation of the measured
/// point in Ftool by effects.
Pose<double> measured_pose(const HostModel& model, const Calibration& calibration,
                           const std::array<double, joint_count>& q_rad,
                           const Context<double, joint_count>& context);

}  // namespace flexcomp::host
