// SPDX-License-Identifier: Apache-2.0
/// \file
/// The difference of two parameter sets as JSON.
#ifndef FLEXCOMP_HOST_MODEL_SET_DIFFERENCE_JSON_HPP
#define FLEXCOMP_HOST_MODEL_SET_DIFFERENCE_JSON_HPP

#include <nlohmann/json_fwd.hpp>

#include "model/set_difference.hpp"

namespace flexcomp::host {

/// {"unchanged", "tool": {…}, "parameters": […]}, in the units of files.
nlohmann::ordered_json to_json(const SetDifference& d);

}  // namespace flexcomp::host

#endif
