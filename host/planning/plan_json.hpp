// SPDX-License-Identifier: Apache-2.0
/// \file
/// A plan as JSON.
#pragma once

#include "json.hpp"
#include "planning/plan_result.hpp"

namespace flexcomp::host {

/// \param output  the plan's file
Json to_json(const PlanTask& task, const PlanResult& result, const std::string& output);

}  // namespace flexcomp::host
