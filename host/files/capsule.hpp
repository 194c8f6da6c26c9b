// SPDX-License-Identifier: Apache-2.0
/// \file
/// Reads capsules from the fields of robot and cell files.
#pragma once

#include "model/robot.hpp"

namespace flexcomp::host {

class YamlField;

/// Reads a body of the robot: frame, from_mm, to_mm, radius_mm. \throws InputError
Capsule read_capsule(const YamlField& field);

/// Reads a fixed body: the same keys, in F0; `frame` may be absent and is 0. \throws InputError
Capsule read_fixed_capsule(const YamlField& field);

}  // namespace flexcomp::host
