// SPDX-License-Identifier: Apache-2.0
#include "kinematics/measured_pose.hpp"

#include "flexcomp/forward.hpp"

namespace flexcomp::host {

Pose<double> measured_pose(const HostModel& model, const Calibration& calibration,
                           const std::array<double, joint_count>& q_rad,
                           const Context<double, joint_count>& context) {
  Workspace<double, joint_count> workspace;
  const Pose<double> tool = forward(model, q_rad, context, workspace);
  Pose<double> point = calibration.e();
  point.position += workspace.point;
  return calibration.f() * (tool * point);
}

}  // namespace flexcomp::host
