// SPDX-License-Identifier: Apache-2.0
/// \file
/// The core's model with room for everything that a calibration on the host may hold.
#pragma once

#include <memory>
#include <string>

#include "flexcomp/model.hpp"
#include "model/robot.hpp"
#include "model/term_set.hpp"

namespace flexcomp::host {

using HostCapacity = Capacity<512, 64, 8192>;
using HostModel = Model<double, joint_count, HostCapacity>;

/// Prepares a set; on the heap, for it is large. `source` is named in the message.
/// \throws InputError  with the core's reason
std::unique_ptr<HostModel> prepare(const TermSet& set, const Robot& robot, const std::string& source);

}  // namespace flexcomp::host
