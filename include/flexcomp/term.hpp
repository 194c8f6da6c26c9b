// SPDX-License-Identifier: Apache-2.0
/// \file
/// Terms (docs/model.md, M5): value of a slot = nominal + sum of coefficient x basis. A term is a place in
/// the chain, a basis it is proportional to, and a coefficient.
#ifndef FLEXCOMP_TERM_HPP
#define FLEXCOMP_TERM_HPP

#include <cstddef>
#include <cstdint>

#include "flexcomp/effect.hpp"

namespace flexcomp {

/// The part of the arm that a place belongs to. The numbers are on the wire: add, never change.
/// 1 … 32 are the links, counted from 1.
namespace body {
constexpr std::uint8_t base = 0;       ///< B: Trans(x,y,z) Rot(z,rz) Rot(y,ry) Rot(x,rx)
constexpr std::uint8_t max_link = 32;  ///< highest number of a link
constexpr std::uint8_t tool = 0x40;    ///< multiplies the nominal tool from the right, in the base's order
constexpr std::uint8_t load = 0x41;    ///< payload: a change of it before torques are computed
constexpr std::uint8_t point = 0x42;   ///< E: translation of the measured point in Ftool; never pushed
}  // namespace body

/// Slots of a link (M2): Rot(z,theta) Trans(z,d) Trans(x,a) Rot(y,gamma) Rot(x,alpha) Rot(y,beta); of base,
/// tool and point (M3); of the payload. gamma has no constant part: it takes the tilt of axis_wobble.
namespace slot {
constexpr std::uint8_t theta = 0;  ///< rad
constexpr std::uint8_t d = 1;      ///< m
constexpr std::uint8_t a = 2;      ///< m
constexpr std::uint8_t alpha = 3;  ///< rad
constexpr std::uint8_t beta = 4;   ///< rad
constexpr std::uint8_t gamma = 5;  ///< rad
// Base and tool; the point has x, y, z only.
constexpr std::uint8_t x = 0;   ///< m
constexpr std::uint8_t y = 1;   ///< m
constexpr std::uint8_t z = 2;   ///< m
constexpr std::uint8_t rx = 3;  ///< rad
constexpr std::uint8_t ry = 4;  ///< rad
constexpr std::uint8_t rz = 5;  ///< rad
// Payload.
constexpr std::uint8_t mass = 0;   ///< kg
constexpr std::uint8_t com_x = 1;  ///< centre of mass in F6, m
constexpr std::uint8_t com_y = 2;  ///< centre of mass in F6, m
constexpr std::uint8_t com_z = 3;  ///< centre of mass in F6, m
}  // namespace slot

/// Place of a term: a body and one of its slots.
struct Place {
  std::uint8_t body = 0;  ///< namespace body, or the number of a link
  std::uint8_t slot = 0;  ///< namespace slot
};

/// Same body and slot.
constexpr bool operator==(Place a, Place b) { return a.body == b.body && a.slot == b.slot; }
/// Another body or slot.
constexpr bool operator!=(Place a, Place b) { return !(a == b); }

/// Basis of a term, phi of (M5). Numbers are on the wire: add, never change. `joint` counts from 0.
enum class Basis : std::uint8_t {
  one = 0,          ///< 1: a geometric error
  load_torque = 1,  ///< tau_joint (M11), N·m: torque of payload and external force about the joint's axis
  load_torque_cubed = 2,  ///< tau_joint^3, (N·m)^3
  link_weight = 3,        ///< lever s of the link of `joint` with `distal_joint` (docs/model.md, M13), 1
  joint_position = 4,     ///< q_joint, rad
  sine = 5,               ///< sin(argument * q_joint)
  cosine = 6,             ///< cos(argument * q_joint)
  direction = 7,          ///< -direction_joint: the link lags behind the motion
  relative_speed = 8,     ///< u_joint
  thermal = 9,            ///< (T - reference) * nominal length of the place (a or d of a link), K·m
  time = 10,              ///< time_s
  load_moment_x = 11,     ///< load moment (M10) about x of link `joint` at that link's origin, N·m
  load_moment_y = 12,     ///< load moment about y of link `joint` at that link's origin, N·m
  base_moment_x = 13,     ///< load moment about x of F0 through (0, 0, argument), N·m
  base_moment_y = 14,     ///< load moment about y of F0 through (0, 0, argument), N·m
  curve = 15,             ///< periodic cubic B-spline (M6) of q_joint in table `table`, times `factor`
  step = 16,              ///< 1 where time_s >= argument, else 0
  grid = 17,              ///< bilinear table (M7) of two covariates in table `table`, constant outside
};
constexpr std::uint8_t basis_count = 18;  ///< bases that this build evaluates: 0 … 17

/// Factor of a curve (M6). Numbers are on the wire: add, never change.
enum class Factor : std::uint8_t {
  one = 0,          ///< 1
  load_torque = 1,  ///< tau_joint, N·m
  temperature = 2,  ///< T - reference, K
  payload = 3,      ///< payload mass, kg
};

/// Covariate along one side of a grid (M7). Numbers are on the wire: add, never change.
enum class Covariate : std::uint8_t {
  joint_position = 0,  ///< q_joint, rad
  payload = 1,         ///< kg
  temperature = 2,     ///< deg C
  time = 3,            ///< s
  direction = 4,       ///< direction_joint
  relative_speed = 5,  ///< u_joint
};

/// Table of a term that has none.
constexpr std::uint16_t no_table = 0xFFFF;

/// One term of (M5): place x basis x coefficient.
template <class S>
struct Term {
  Place place{};                      ///< slot that it adds to
  Basis basis = Basis::one;           ///< what it is proportional to
  std::uint8_t joint = 0;             ///< the joint or link (from 0) that the basis reads
  Factor factor = Factor::one;        ///< of a curve
  Effect effect = Effect::geometric;  ///< of the catalogue
  std::uint16_t instance = 0;         ///< terms of one effect with the same number are one entry of it
  std::uint16_t table = no_table;     ///< index into the tables
  std::uint8_t distal_joint = 0;  ///< of a link-weight lever: the joint (from 0) at its distal end; 0: none
  S argument = S(0);              ///< order, pivot height (m) or time (s), by basis
  S coefficient = S(1);           ///< unit of the place (rad, m, kg) per unit of the basis
};

/// Table of a curve (M6) or a grid (M7): `size` scalars from `offset` of one common array.
/// Curve: the spline coefficients c_0 … c_{M-1}, 6 <= M <= 256.
/// Grid: nodes of the first side (ascending), nodes of the second, then values row by row (first side =
/// rows).
struct Table {
  std::uint16_t offset = 0;                                ///< index of the first value
  std::uint16_t size = 0;                                  ///< number of values
  std::uint16_t rows = 0;                                  ///< grid: nodes of the first side, 0 for a curve
  std::uint16_t columns = 0;                               ///< grid: nodes of the second side
  Covariate row_covariate = Covariate::joint_position;     ///< grid: along the first side
  Covariate column_covariate = Covariate::joint_position;  ///< grid: along the second side
  std::uint8_t row_joint = 0;                              ///< grid: joint (from 0) of the first covariate
  std::uint8_t column_joint = 0;                           ///< grid: joint (from 0) of the second covariate
};

/// List of terms with their tables; does not own them.
template <class S>
struct TermList {
  const Term<S>* terms = nullptr;  ///< `count` terms
  std::size_t count = 0;           ///< number of terms
  const Table* tables = nullptr;   ///< `table_count` tables
  std::size_t table_count = 0;     ///< number of tables
  const S* values = nullptr;       ///< `value_count` values of all tables
  std::size_t value_count = 0;     ///< number of values
};

/// True where a table lies within the list's values.
template <class S>
constexpr bool has_values(const TermList<S>& list, const Table& table) {
  return std::size_t{table.offset} + table.size <= list.value_count;
}

/// True where the basis needs torques, levers or moments, which are computed in the chain without effects
/// (M15).
constexpr bool needs_loads(Basis b, Factor f) {
  return b == Basis::load_torque || b == Basis::load_torque_cubed || b == Basis::link_weight ||
         b == Basis::load_moment_x || b == Basis::load_moment_y || b == Basis::base_moment_x ||
         b == Basis::base_moment_y || (b == Basis::curve && f == Factor::load_torque);
}

/// True for a term that becomes part of the constant chain when a model is prepared.
template <class S>
constexpr bool is_constant(const Term<S>& t) {
  return t.basis == Basis::one && t.place.body != body::point &&
         !(t.place.slot == slot::gamma && t.place.body >= 1 && t.place.body <= body::max_link);
}

}  // namespace flexcomp

#endif
