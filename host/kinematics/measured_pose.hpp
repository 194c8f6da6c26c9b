// SPDX-License-Identifier: Apache-2.0
/// \file
/// From a model to what an instrument sees.
#ifndef FLEXCOMP_HOST_KINEMATICS_MEASURED_POSE_HPP
#define FLEXCOMP_HOST_KINEMATICS_MEASURED_POSE_HPP

#include <array>

#include "flexcomp/linear.hpp"
#include "flexcomp/robot.hpp"
#include "model/calibration.hpp"
#include "model/host_model.hpp"

namespace flexcomp::host {

/// F · B A1 … A6 Tool · slip · E: the measured point or frame in the frame of the instrument. A slip of the measured point
/// (reflector_slip) is a translation in Ftool.
Pose<double> measured_pose(const HostModel& model, const Calibration& calibration,
                           const std::array<double, joint_count>& q_rad,
                           const Context<double, joint_count>& context);

}  // namespace flexcomp::host

#endif
