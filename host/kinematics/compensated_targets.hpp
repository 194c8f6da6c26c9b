// SPDX-License-Identifier: Apache-2.0
/// \file
/// Corrected joint commands for a list of targets, as the controller would give them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "flexcomp/status.hpp"
#include "model/calibration.hpp"
#include "model/parameter_image.hpp"
#include "model/targets.hpp"

namespace flexcomp::host {

struct Answer {
  std::array<double, joint_count> q_rad{};  ///< corrected command
  double residual_m = 0;                    ///< what the flexible model still misses of the target
  double residual_rad = 0;
  StepStatus status = StepStatus::no_set;
  std::uint16_t flags = step_flag::no_set;  ///< all that hold, bits of step_flag
};

/// \param commands  joint_commands() of the targets
/// \throws InputError  a calibration of which no image can be made, or that a controller cannot hold
std::vector<Answer> compensated(const TargetsFile& targets,
                                const std::vector<std::array<double, joint_count>>& commands,
                                const Calibration& calibration, const Robot& robot,
                                const ImageOptions& options = {});

}  // namespace flexcomp::host
