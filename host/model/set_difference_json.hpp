// SPDX-License-Identifier: Apache-2.0
/// \file
/// The difference of two parameter sets as JSON.
#ifndef FLEXCOMP_HOST_MODEL_SET_DIFFERENCE_JSON_HPP
#define FLEXCOMP_HOST_MODEL_SET_DIFFERENCE_JSON_HPP

#include "json.hpp"
#include "model/set_difference.hpp"

namespace flexcomp::host {

/// {"unchanged", "tool": {…}, "parameters": […]}, in the units of files.
Json to_json(const SetDifference& d);

}  // namespace flexcomp::host

#endif
