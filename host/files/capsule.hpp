// SPDX-License-Identifier: Apache-2.0
/// \file
/// Reads capsules from the fields of robot and cell files.
#ifndef FLEXCOMP_HOST_FILES_CAPSULE_HPP
#define FLEXCOMP_HOST_FILES_CAPSULE_HPP

#include "model/capsule.hpp"

namespace flexcomp::host {

class YamlField;

/// A body of the robot: frame, from_mm, to_mm, radius_mm. \throws InputError
Capsule read_capsule(const YamlField& field);

/// A body that stands still: the same keys, in F0; `frame` may be left out and is 0. \throws InputError
Capsule read_fixed_capsule(const YamlField& field);

}  // namespace flexcomp::host

#endif
