// SPDX-License-Identifier: Apache-2.0
/// \file
/// Where the solution of J dq = e is damped (docs/compensation.md, C9): thresholds that follow from how far a set moves the
/// tool, from the arm's reach and from the slope that a correction may have.
#ifndef FLEXCOMP_SINGULAR_REGION_HPP
#define FLEXCOMP_SINGULAR_REGION_HPP

#include <array>
#include <cmath>
#include <cstddef>

#include "flexcomp/bounds.hpp"
#include "flexcomp/bytes.hpp"
#include "flexcomp/linear.hpp"
#include "flexcomp/term.hpp"

namespace flexcomp {

/// How far a set moves the tool at most, and the arm's reach.
template <class S>
struct ToolMotion {
  S position_m = S(0);       ///< bound of the motion of the tool point
  S orientation_rad = S(0);  ///< bound of the tool's turn
  S reach_m = S(0);          ///< largest distance of the tool point from axis 1
};

/// Thresholds of the eigenvalues below which a block is damped (C9), squares of singular values.
template <class S>
struct SingularRegion {
  S position = S(0);        ///< of P, m^2
  S orientation = S(0);     ///< of M against W = 1 + length^2 G G^T
  S length_squared = S(0);  ///< of position against orientation in W, m^2
};

/// Least threshold, a singular value: what the scalar's rounding allows.
template <class S>
struct LeastSingular {
  static constexpr double squared = 4e-6;  ///< 0.002 squared
};
/// The same in single precision.
template <>
struct LeastSingular<float> {
  static constexpr float squared = 4e-4F;  ///< 0.02 squared
};

/// Thresholds (C9) for a set that moves the tool by `motion`. None is above 0.1 as a singular value with lengths in m, so an arm
/// whose Jacobian has none below that is never damped.
template <class S>
inline SingularRegion<S> singular_region(const ToolMotion<S>& motion,
                                         const CompensationSettings<S>& settings) {
  SingularRegion<S> region;
  S length = S(0.5) * motion.reach_m;
  if (!(length < S(1))) length = S(1);
  const S per_slope = motion.reach_m / settings.steepest;
  region.length_squared = length * length;
  region.position = S(17) * motion.position_m * per_slope;
  region.orientation =
      S(0.7) * (motion.position_m + motion.orientation_rad * length) * per_slope / region.length_squared;
  for (S* const threshold : {&region.position, &region.orientation}) {
    if (!(*threshold <= S(0.01))) *threshold = S(0.01);
    if (!(*threshold >= S(LeastSingular<S>::squared))) *threshold = S(LeastSingular<S>::squared);
  }
  return region;
}

namespace detail {

/// ToolMotion: the sum of what constant terms, compliances at the robot's own payload, link weights, waves and curves of a
/// model do at their worst. Not the certificate's size, which is at ranges that a controller declares: these thresholds are
/// the same on every host and controller. Work linear in terms and table values.
template <class M>
FLEXCOMP_RARE ToolMotion<typename M::Scalar> tool_motion_of(const M& model) {
  using S = typename M::Scalar;
  using std::sqrt;
  constexpr std::size_t n = M::joints;
  const auto abs = [](const S& x) { return x < S(0) ? -x : x; };
  const auto length = [](const S& x, const S& y, const S& z) { return sqrt(x * x + y * y + z * z); };
  const auto& robot = model.robot();
  const auto& gravity = model.gravity();
  const S weight = abs(from_binary64<S>(robot.payload_kg)) * length(gravity[0], gravity[1], gravity[2]);
  std::array<S, M::most_tables> greatest{};
  for (std::size_t k = 0; k < model.table_count(); ++k) {
    const Table& table = model.table(k);
    const S* values = model.values(table);
    for (std::size_t v = 0; v < table.size && table.rows == 0; ++v) {
      if (abs(values[v]) > greatest[k]) greatest[k] = abs(values[v]);
    }
  }
  ToolMotion<S> motion;
  std::array<S, n> turn_of{};
  for (std::size_t k = 0; k < model.effect_count(); ++k) {
    const auto& t = model.effect(k);
    if (t.place.body < 1 || t.place.body > n) continue;
    S size = S(0);
    if (t.basis == Basis::link_weight || t.basis == Basis::sine || t.basis == Basis::cosine)
      size = abs(t.coefficient);
    if (t.basis == Basis::curve && t.factor == Factor::one) size = abs(t.coefficient) * greatest[t.table];
    if (t.place.slot == slot::d || t.place.slot == slot::a) {
      motion.position_m += size;
    } else {
      turn_of[t.place.body - 1U] += size;
    }
  }
  const auto& tool = model.nominal_tool().position;
  S reach = length(tool[0], tool[1], tool[2]);
  S arm = length(from_binary64<S>(robot.payload_com_m[0]), from_binary64<S>(robot.payload_com_m[1]),
                 from_binary64<S>(robot.payload_com_m[2]));
  for (std::size_t i = n; i-- > 0;) {
    const auto& twist = model.plan().link_twist(i);
    S turn = length(twist.angular.x, twist.angular.y, twist.angular.z);
    motion.position_m += length(twist.linear.x, twist.linear.y, twist.linear.z) + turn * reach;
    motion.orientation_rad += turn;
    const S link = length(model.nominal(i).a, i == 0 ? S(0) : model.nominal(i).d, S(0));
    reach += link;
    arm += link;
    turn = turn_of[i] + abs(model.plan().compliance(i)) * weight * arm;
    motion.position_m += turn * reach;
    motion.orientation_rad += turn;
  }
  const auto& base = model.plan().base_twist();
  const S turn = length(base.angular.x, base.angular.y, base.angular.z);
  motion.position_m += length(base.linear.x, base.linear.y, base.linear.z) + turn * reach;
  motion.orientation_rad += turn;
  motion.reach_m = reach;
  return motion;
}

}  // namespace detail
}  // namespace flexcomp

#endif
