// SPDX-License-Identifier: Apache-2.0
/// \file
/// What the control cycle needs of a prepared model beside its chain: effects sorted by the kernel that evaluates them,
/// first-order motions of the constant terms, reach (docs/compensation.md, section 2).
#ifndef FLEXCOMP_DETAIL_CYCLE_PLAN_HPP
#define FLEXCOMP_DETAIL_CYCLE_PLAN_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "flexcomp/detail/link_shape.hpp"
#include "flexcomp/linear.hpp"
#include "flexcomp/term.hpp"

namespace flexcomp {
namespace detail {

/// Groups of effects by the kernel that evaluates them. The first `count` are lists of a plan, in this order.
namespace group {
constexpr std::uint8_t lever = 0;   ///< turns a joint by link weight, (M13)
constexpr std::uint8_t loaded = 1;  ///< turns a joint by another torque or moment, cubed, or times a curve
constexpr std::uint8_t own = 2;     ///< turns a joint by that joint's own reading, (C14)
constexpr std::uint8_t other = 3;   ///< turns a joint by other readings and the context
constexpr std::uint8_t move = 4;    ///< moves a link, the base or the tool
constexpr std::uint8_t count = 5;
constexpr std::uint8_t own_compliance = 6;  ///< added up in one coefficient for each joint, (M12)
constexpr std::uint8_t none = 7;            ///< moves what is measured, not the arm
}  // namespace group

/// The group of an effect that a model of N joints has accepted.
template <std::size_t N, class S>
inline std::uint8_t effect_group(const Term<S>& t) {
  if (t.place.body == body::point) return group::none;
  if (t.place.body < 1 || t.place.body > N || t.place.slot != slot::theta) return group::move;
  const bool of_itself = t.joint + 1U == t.place.body;
  if (t.basis == Basis::load_torque && of_itself) return group::own_compliance;
  if (t.basis == Basis::link_weight) return group::lever;
  if (needs_loads(t.basis, t.factor)) return group::loaded;
  const bool of_reading = t.basis == Basis::curve || t.basis == Basis::joint_position ||
                          t.basis == Basis::sine || t.basis == Basis::cosine;
  return of_reading && of_itself ? group::own : group::other;
}

/// First rotation times the inverse of the second.
template <class S>
inline Matrix3<S> turn_between(const Matrix3<S>& a, const Matrix3<S>& b) {
  Matrix3<S> turn;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) turn(r, c) = a(r, 0) * b(c, 0) + a(r, 1) * b(c, 1) + a(r, 2) * b(c, 2);
  }
  return turn;
}

/// See the head of the file. Prepared by set(), then only read.
template <class S, std::size_t N, class Cap>
class CyclePlan {
 public:
  /// Sorts the effects of a model whose chain, base and tool are prepared.
  template <class Model>
  FLEXCOMP_RARE void set(const Model& model) {
    sort(model);
    const Vector3<S>& g = model.gravity();
    using std::sqrt;
    const S square = dot<S>(g, g);
    inverse_gravity_ = square > S(0) ? S(1) / sqrt(square) : S(0);
    tool_turn_ = turn_between(model.nominal_tool().rotation, model.tool_pose().rotation);
    compute_twists(model);
    const Vector3<S>& tool = model.nominal_tool().position;
    reach_ = sqrt(dot<S>(tool, tool));
    for (std::size_t i = 0; i < N; ++i) {
      const S a = model.nominal(i).a, d = model.nominal(i).d;
      reach_ += sqrt(a * a + d * d);
    }
  }

  /// Number of effects of a group.
  std::size_t size(std::uint8_t g) const { return end_[g] - (g == 0 ? std::size_t{0} : end_[g - 1U]); }
  /// Index in the model of effect k of a group; equal levers are adjacent.
  std::size_t index(std::uint8_t g, std::size_t k) const {
    return order_[(g == 0 ? std::size_t{0} : end_[g - 1U]) + k];
  }
  /// Compliance of joint i (from 0) to its own load torque (M12), rad/(N·m); the sum of all such terms.
  S compliance(std::size_t i) const { return compliance_[i]; }
  /// True where some effect follows a moment on a link or the base.
  bool needs_moments() const { return needs_moments_; }
  S inverse_gravity() const { return inverse_gravity_; }  ///< s^2/m; 0 without gravity
  S reach() const { return reach_; }                      ///< m; no point of the arm is farther from another
  /// Nominal tool rotation times the inverse of the one with constant terms.
  const Matrix3<S>& tool_turn() const { return tool_turn_; }
  /// Motion by the constant terms of link i (from 0), in the frame after it and to first order (C3); the last one
  /// includes those of the tool.
  const SmallMotion<S>& link_twist(std::size_t i) const { return link_twist_[i]; }
  /// Motion by B, in Fb at its origin, to first order (C3).
  const SmallMotion<S>& base_twist() const { return base_twist_; }

 private:
  using Count = std::conditional_t<Cap::terms <= 255, std::uint8_t, std::uint16_t>;

  template <class Model>
  FLEXCOMP_RARE void sort(const Model& model) {
    for (S& c : compliance_) c = S(0);
    needs_moments_ = false;
    std::array<std::uint8_t, Cap::terms> group_of{};
    for (std::size_t k = 0; k < model.effect_count(); ++k) {
      const Term<S>& t = model.effect(k);
      group_of[k] = effect_group<N>(t);
      if (is_moment(t.basis)) needs_moments_ = true;
      if (group_of[k] == group::own_compliance) compliance_[t.joint] += t.coefficient;
    }
    std::size_t n = 0;
    for (std::uint8_t g = 0; g < group::count; ++g) {
      if (g == group::lever) {
        n = order_levers(model, group_of);
      } else {
        for (std::size_t k = 0; k < model.effect_count(); ++k) {
          if (group_of[k] == g) order_[n++] = static_cast<Count>(k);
        }
      }
      end_[g] = static_cast<Count>(n);
    }
  }

  /// Orders the levers, the first group, by joint and distal joint, so that each is taken once; their number. Counting
  /// sort: work linear in the terms.
  template <class Model>
  std::size_t order_levers(const Model& model, const std::array<std::uint8_t, Cap::terms>& group_of) {
    const auto key = [&model](std::size_t k) {
      return model.effect(k).joint * N + model.effect(k).distal_joint;
    };
    std::array<Count, N * N + 1> start{};
    for (std::size_t k = 0; k < model.effect_count(); ++k) {
      if (group_of[k] == group::lever) ++start[key(k) + 1];
    }
    for (std::size_t i = 0; i < N * N; ++i) start[i + 1] = static_cast<Count>(start[i + 1] + start[i]);
    const std::size_t count = start[N * N];
    for (std::size_t k = 0; k < model.effect_count(); ++k) {
      if (group_of[k] == group::lever) order_[start[key(k)]++] = static_cast<Count>(k);
    }
    return count;
  }

  template <class Model>
  FLEXCOMP_RARE void compute_twists(const Model& model) {
    for (std::size_t i = 0; i < N; ++i) {
      const SinCos<S> none = {S(0), S(1)};
      link_twist_[i] = twist_between(link_at_zero(model.nominal(i), none),
                                     link_at_zero(model.shape(i), sin_cos(model.constant_theta(i))));
    }
    // The motion of the tool is given in the flange frame, as that of the last link.
    const SmallMotion<S> tool = twist_between(model.nominal_tool(), model.tool_pose());
    const Mat3<S> turned = columns_of(model.nominal_tool().rotation);
    const Vec3<S> angular = combine(turned, tool.angular);
    SmallMotion<S>& last = link_twist_[N - 1];
    last.linear =
        last.linear + combine(turned, tool.linear) + cross(vec3<S>(model.nominal_tool().position), angular);
    last.angular = last.angular + angular;
    base_twist_ = twist_between(Pose<S>(), model.base_pose());
  }

  static bool is_moment(Basis b) {
    return b == Basis::load_moment_x || b == Basis::load_moment_y || b == Basis::base_moment_x ||
           b == Basis::base_moment_y;
  }

  std::array<S, N> compliance_{};
  S inverse_gravity_ = S(0);
  S reach_ = S(0);
  std::array<SmallMotion<S>, N> link_twist_{};
  SmallMotion<S> base_twist_{};
  Matrix3<S> tool_turn_ = Matrix3<S>::Identity();
  std::array<Count, group::count> end_{};
  std::array<Count, Cap::terms> order_{};
  bool needs_moments_ = false;
};

}  // namespace detail
}  // namespace flexcomp

#endif
