// SPDX-License-Identifier: Apache-2.0
/// \file
/// Reads tolerance files: prior standard deviations of the parameters' differences from nominal (docs/files.md).
#pragma once

#include <string>
#include <vector>

#include "model/tolerance.hpp"

namespace flexcomp::host {

/// Reads a tolerance file: `tolerances:` with, per line, `pattern: sigma` or `pattern: {expected: e, sigma: s}`.
/// \throws InputError  no such file, no YAML, an unknown key, a sigma that is not above 0
std::vector<Tolerance> load_tolerances(const std::string& path);

}  // namespace flexcomp::host
