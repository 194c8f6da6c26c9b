// SPDX-License-Identifier: Apache-2.0
/// \file
/// Scan of the residual for unnamed functions that are concentrated near one pair of joint readings (D10).
#ifndef FLEXCOMP_HOST_DIAGNOSIS_BUMP_FUNCTIONS_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_BUMP_FUNCTIONS_HPP

#include <cstddef>
#include <vector>

#include "diagnosis/smooth_functions.hpp"

namespace flexcomp::host {

/// The best bumps of two joint readings that turn a joint, best first; each has four parameters: size, two centres, width.
std::vector<SmoothFunction> bump_functions(const GapSystem& system, const ResidualAnalysis& left,
                                           const std::vector<Variable>& of, std::size_t most);

}  // namespace flexcomp::host

#endif
