// SPDX-License-Identifier: Apache-2.0
/// \file
/// The parameters of the paper's model on any arm (docs/model.md, M4).
#pragma once

#include <array>

#include "model/effects.hpp"
#include "model/term_set.hpp"
#include "units.hpp"

namespace flexcomp::host {

/// Axes nearer to parallel or antiparallel than this are treated as parallel. The feet of their common normal move by
/// (distance of the axes) · (error of direction) / (angle between them): d would have to follow an error of 0.05 degrees by
/// 2 mm at 15 degrees, by 70 mm at 2 degrees, by metres below.
constexpr double parallel_within_rad = radians(15);

/// Links whose joint axis is nominally parallel to the next one's (parallel_within_rad): there d cannot be told from the
/// neighbour's and beta takes its place (Hayati). From the geometry alone, for any arm; link 6 has no next one.
std::array<bool, joint_count> takes_beta(const Nominal& robot);

/// True where link_gravity applies: gravity lies along the axis of joint 1.
bool gravity_is_axial(const Nominal& robot);

enum class ModelKind { full, geometric, no_gravity, no_stiffness };

/// The model of the paper for any arm, all coefficients zero: theta, d, a, alpha, beta of links 1 to 6 (24), base (6),
/// joint compliances (6), link gravity (3). Without base where frames are fitted. Gravity is left out where
/// !gravity_is_axial().
ParametricModel paper_model(const Nominal& robot, ModelKind kind, bool with_base);

}  // namespace flexcomp::host
