// SPDX-License-Identifier: Apache-2.0
/// \file
/// Where an arm goes, by the forward kinematics that the whole host uses.
#pragma once

#include <array>
#include <memory>

#include "flexcomp/forward.hpp"
#include "model/host_model.hpp"

namespace support {

/// Ftool in F0 of a robot with a set of terms; without one the nominal arm.
class MovingArm {
 public:
  explicit MovingArm(const flexcomp::host::Robot& robot, const flexcomp::host::TermSet& set = {})
      : context(flexcomp::default_context<double>(robot.nominal)),
        model_(flexcomp::host::prepare(set, robot, "arm of a test")) {}

  flexcomp::Pose<double> operator()(const std::array<double, 6>& q_rad) const {
    flexcomp::Workspace<double, 6> workspace;
    return flexcomp::forward(*model_, q_rad, context, workspace);
  }

  flexcomp::Context<double, 6> context;  ///< of all that follows

 private:
  std::unique_ptr<flexcomp::host::HostModel> model_;
};

}  // namespace support
