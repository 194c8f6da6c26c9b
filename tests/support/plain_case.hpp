// SPDX-License-Identifier: Apache-2.0
/// \file
/// What the core is given, as plain_arm.hpp wants it.
#pragma once

#include "support/arms.hpp"

namespace plain {

inline Nominal nominal_of(const arms::Robot& robot) {
  Nominal n;
  for (std::size_t i = 0; i < 6; ++i) {
    const flexcomp::NominalLink& l = robot.links[i];
    n.links[i] = {l.theta_rad, l.d_m, l.a_m, l.alpha_rad, l.beta_rad};
  }
  n.gravity = Vector(robot.gravity_m_s2.data());
  n.tool_xyz = Vector(robot.tool_xyz_m.data());
  n.tool_wxyz = robot.tool_wxyz;
  n.reference_temperature_c = robot.reference_temperature_c;
  return n;
}

inline Situation situation_of(const flexcomp::Context<double>& c) {
  return {c.payload_kg,
          Vector(c.payload_com_m.data()),
          Vector(c.force_n.data()),
          c.temperature_c,
          c.time_s,
          c.direction,
          c.relative_speed};
}

/// x y z rx ry rz.
inline std::array<double, 6> six(const Small& v) { return {v.x, v.y, v.z, v.rx, v.ry, v.rz}; }

}  // namespace plain
