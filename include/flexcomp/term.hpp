// SPDX-License-Identifier: Apache-2.0
/// \file
/// One idea carries everything: place x basis x coefficient. A term says where in the chain an error acts,
/// what it is proportional to, and how much.
#ifndef FLEXCOMP_TERM_HPP
#define FLEXCOMP_TERM_HPP

#include <cstddef>
#include <cstdint>

#include "flexcomp/effect.hpp"

namespace flexcomp {

/// The part of the arm that a place belongs to. The numbers are on the wire: add, never change.
/// 1 … 32 are the links, counted from 1.
namespace body {
constexpr std::uint8_t base = 0;  ///< B: Trans(x,y,z) Rot(z,rz) Rot(y,ry) Rot(x,rx)
constexpr std::uint8_t max_link = 32;
constexpr std::uint8_t tool = 0x40;   ///< multiplies the nominal tool from the right, in the base's order
constexpr std::uint8_t load = 0x41;   ///< an edit of the payload before torques are taken
constexpr std::uint8_t point = 0x42;  ///< E: translation of the measured point in Ftool; never pushed
}  // namespace body

/// Slots of a link: Rot(z,theta) Trans(z,d) Trans(x,a) Rot(y,gamma) Rot(x,alpha) Rot(y,beta). gamma has no
/// constant part; it is there for wobble (a tilt about y, perpendicular to the joint's axis).
namespace slot {
constexpr std::uint8_t theta = 0;
constexpr std::uint8_t d = 1;
constexpr std::uint8_t a = 2;
constexpr std::uint8_t alpha = 3;
constexpr std::uint8_t beta = 4;
constexpr std::uint8_t gamma = 5;
// Base and tool (m, rad); the point has x, y, z only.
constexpr std::uint8_t x = 0;
constexpr std::uint8_t y = 1;
constexpr std::uint8_t z = 2;
constexpr std::uint8_t rx = 3;
constexpr std::uint8_t ry = 4;
constexpr std::uint8_t rz = 5;
// Load: kg, then m in F6.
constexpr std::uint8_t mass = 0;
constexpr std::uint8_t com_x = 1;
constexpr std::uint8_t com_y = 2;
constexpr std::uint8_t com_z = 3;
}  // namespace slot

struct Place {
  std::uint8_t body = 0;
  std::uint8_t slot = 0;
};

constexpr bool operator==(Place a, Place b) { return a.body == b.body && a.slot == b.slot; }
constexpr bool operator!=(Place a, Place b) { return !(a == b); }

/// What a term is proportional to. Registered here, on the wire, never reused. `joint` counts from 0.
enum class Basis : std::uint8_t {
  one = 0,                ///< 1: a geometric error
  load_torque = 1,        ///< tau_joint, N·m: torque of payload and external force about the joint's axis
  load_torque_cubed = 2,  ///< tau_joint^3
  link_weight =
      3,  ///< lever s of the link of `joint` (docs/model.md, M13); `argument` = joint of the far point
  joint_position = 4,  ///< q_joint, rad
  sine = 5,            ///< sin(argument * q_joint)
  cosine = 6,          ///< cos(argument * q_joint)
  direction = 7,       ///< -direction_joint: the link stays behind the motion
  relative_speed = 8,  ///< u_joint
  thermal = 9,         ///< (T - reference) * nominal length of the place (a or d of a link), K·m
  time = 10,           ///< time_s
  load_moment_x = 11,  ///< load moment about x of link `joint` at that link's origin, N·m
  load_moment_y = 12,  ///< load moment about y of link `joint` at that link's origin, N·m
  base_moment_x = 13,  ///< load moment about x of F0 through (0, 0, argument), N·m
  base_moment_y = 14,  ///< load moment about y of F0 through (0, 0, argument), N·m
  curve = 15,          ///< periodic cubic B-spline of q_joint in table `table`, times `factor`
  step = 16,           ///< 1 where time_s >= argument, else 0
  grid = 17,           ///< bilinear table of two covariates in table `table`, constant outside
};
constexpr std::uint8_t basis_count = 18;

/// What a curve is multiplied by.
enum class Factor : std::uint8_t {
  one = 0,
  load_torque = 1,  ///< tau_joint, N·m
  temperature = 2,  ///< T - reference, K
  payload = 3,      ///< payload mass, kg
};

/// The variable along one side of a grid: a kind, and a joint where the kind needs one.
enum class Covariate : std::uint8_t {
  joint_position = 0,  ///< q_joint, rad
  payload = 1,         ///< kg
  temperature = 2,     ///< deg C
  time = 3,            ///< s
  direction = 4,       ///< direction_joint
  relative_speed = 5,  ///< u_joint
};

constexpr std::uint16_t no_table = 0xFFFF;

/// One term. Coefficient in the unit of the place (rad, m, kg) per unit of the basis.
template <class S>
struct Term {
  Place place{};
  Basis basis = Basis::one;
  std::uint8_t joint = 0;             ///< the joint or link (from 0) that the basis reads
  Factor factor = Factor::one;        ///< of a curve
  Effect effect = Effect::geometric;  ///< the name it goes by
  std::uint16_t instance = 0;         ///< terms of one effect with the same number enter and leave together
  std::uint16_t table = no_table;     ///< index into the tables
  S argument = S(0);                  ///< order, pivot height (m), time (s) or far joint, by basis
  S coefficient = S(1);
};

/// A table of values that a curve or a grid reads: `size` scalars from `offset` of one common array.
/// Curve: the spline coefficients c_0 … c_{M-1}, 6 <= M <= 256.
/// Grid: nodes of the first side (ascending), nodes of the second, then values row by row (first side =
/// rows).
struct Table {
  std::uint16_t offset = 0;
  std::uint16_t size = 0;
  std::uint16_t rows = 0;     ///< grid: nodes of the first side, 0 for a curve
  std::uint16_t columns = 0;  ///< grid: nodes of the second side
  Covariate row_covariate = Covariate::joint_position;
  Covariate column_covariate = Covariate::joint_position;
  std::uint8_t row_joint = 0;
  std::uint8_t column_joint = 0;
};

/// A list of terms with their tables; does not own them.
template <class S>
struct TermList {
  const Term<S>* terms = nullptr;
  std::size_t count = 0;
  const Table* tables = nullptr;
  std::size_t table_count = 0;
  const S* values = nullptr;
  std::size_t value_count = 0;
};

/// True where a table lies within the list's values.
template <class S>
constexpr bool has_values(const TermList<S>& list, const Table& table) {
  return std::size_t{table.offset} + table.size <= list.value_count;
}

/// True where the basis needs torques, levers or moments, which are taken in the chain without effects.
constexpr bool needs_loads(Basis b, Factor f) {
  return b == Basis::load_torque || b == Basis::load_torque_cubed || b == Basis::link_weight ||
         b == Basis::load_moment_x || b == Basis::load_moment_y || b == Basis::base_moment_x ||
         b == Basis::base_moment_y || (b == Basis::curve && f == Factor::load_torque);
}

/// True for a term that is folded into the constant chain once.
template <class S>
constexpr bool is_constant(const Term<S>& t) {
  return t.basis == Basis::one && t.place.body != body::point &&
         !(t.place.slot == slot::gamma && t.place.body >= 1 && t.place.body <= body::max_link);
}

}  // namespace flexcomp

#endif
