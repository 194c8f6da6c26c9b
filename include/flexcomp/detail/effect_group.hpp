// SPDX-License-Identifier: Apache-2.0
/// \file
/// Groups of a model's effects by the kernel that evaluates them in the control cycle (docs/compensation.md,
/// section 1).
#ifndef FLEXCOMP_DETAIL_EFFECT_GROUP_HPP
#define FLEXCOMP_DETAIL_EFFECT_GROUP_HPP

#include <cstddef>
#include <cstdint>

#include "flexcomp/term.hpp"

namespace flexcomp {
namespace detail {

/// Groups of effects by the kernel that evaluates them. The first `count` are lists of a model, in this
/// order.
namespace group {
constexpr std::uint8_t lever = 0;         ///< link weight, (M13)
constexpr std::uint8_t other_loaded = 1;  ///< load torque of another joint, cubed, or times a curve
constexpr std::uint8_t own = 2;           ///< of the reading of the joint that is turned, (C14)
constexpr std::uint8_t other = 3;         ///< of other readings and the context
constexpr std::uint8_t count = 4;
constexpr std::uint8_t own_compliance = 5;  ///< added up in one coefficient for each joint, (M12)
constexpr std::uint8_t none = 6;            ///< not for the control cycle, or not for its joint-only path
}  // namespace group

/// The group of an effect that a model of N joints has accepted. `only_joint_deflections` becomes false for
/// one that needs frames or moves more than a joint angle: it is in no list.
template <std::size_t N, class S>
inline std::uint8_t effect_group(const Term<S>& t, bool& only_joint_deflections) {
  if (t.place.body == body::point) return group::none;  // moves what is measured, not the arm
  const bool turns_joint = t.place.body >= 1 && t.place.body <= N && t.place.slot == slot::theta;
  const bool of_itself = t.joint + 1U == t.place.body;
  switch (turns_joint ? t.basis : Basis::load_moment_x) {
    case Basis::load_torque:
      return of_itself ? group::own_compliance : group::other_loaded;
    case Basis::load_torque_cubed:
      return group::other_loaded;
    case Basis::link_weight:
      return group::lever;
    case Basis::curve:
      if (t.factor == Factor::load_torque) return group::other_loaded;
      return of_itself ? group::own : group::other;
    case Basis::joint_position:
    case Basis::sine:
    case Basis::cosine:
      return of_itself ? group::own : group::other;
    case Basis::load_moment_x:
    case Basis::load_moment_y:
    case Basis::base_moment_x:
    case Basis::base_moment_y:
      only_joint_deflections = false;
      return group::none;
    default:
      return group::other;
  }
}

}  // namespace detail
}  // namespace flexcomp

#endif
