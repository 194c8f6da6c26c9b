// SPDX-License-Identifier: Apache-2.0
/// \file
/// Names and units of what errors follow: joint positions and the context of a row.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "flexcomp/term.hpp"
#include "units.hpp"

namespace flexcomp::host {

/// True where the covariate is one of a joint.
bool is_joint_covariate(Covariate covariate);

/// q2, dir3, speed1, payload_kg, temp_c, time_s.
std::string covariate_name(Covariate covariate, unsigned joint);
std::optional<std::pair<Covariate, unsigned>> covariate_of(std::string_view name);
Unit covariate_unit(Covariate covariate);

/// load_torque, temperature, payload; empty for Factor::one.
std::string factor_name(Factor factor);
/// Nothing for a name that is none of a factor.
std::optional<Factor> factor_of(std::string_view name);

}  // namespace flexcomp::host
