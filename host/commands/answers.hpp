// SPDX-License-Identifier: Apache-2.0
/// \file
/// What is answered to targets, by the host (compensate) or by the controller (probe): one file format for both.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "files/data_file.hpp"
#include "json.hpp"
#include "kinematics/compensated_targets.hpp"

namespace flexcomp::host {

/// Words of all flags that hold, joined by +; "ok" where none does.
std::string status_words(std::uint16_t flags);

/// Columns q1_deg … q6_deg, residual_mm, residual_deg, status, and those that were passed through.
std::string answers_text(const TargetsFile& targets, const std::vector<Answer>& answers);

/// Numbers over all answers: counts by status, largest correction, mean and largest residual. `commands` are the joint
/// commands that were answered.
Json answers_summary(const std::vector<std::array<double, joint_count>>& commands,
                     const std::vector<Answer>& answers);

}  // namespace flexcomp::host
