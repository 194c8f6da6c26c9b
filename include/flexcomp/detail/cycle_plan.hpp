// SPDX-License-Identifier: Apache-2.0
/// \file
/// What the control cycle needs of a prepared model beside its chain: effects sorted by the kernel that evaluates them,
/// bounds of their derivatives, first-order motions of the constant terms, reach (docs/compensation.md, section 2).
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

  /// Bounds of the derivatives of the effects, by which the iterations of the deflection end: work linear in the terms and
  /// in the values of all tables.
  template <class Model>
  FLEXCOMP_RARE void bound_derivatives(const Model& model) {
    std::array<Derivatives, Cap::tables> tables{};
    for (std::size_t k = 0; k < model.table_count(); ++k) {
      const Table& table = model.table(k);
      tables[k] =
          table.rows != 0 ? of_grid(model.values(table), table) : of_curve(model.values(table), table);
    }
    std::array<S, N> third{};
    S slope = S(0);
    for (std::uint8_t g = group::loaded; g < group::count; ++g) {
      for (std::size_t k = 0; k < size(g); ++k) {
        const Term<S>& t = model.effect(index(g, k));
        S scale = magnitude(t.coefficient);
        // Temperature and payload are taken as 100 K and kg from where the term is 0.
        if (t.factor != Factor::one) scale *= S(100);
        Derivatives of = {S(0), S(0)};
        if (t.basis == Basis::curve || t.basis == Basis::grid) {
          of = tables[t.table];
        } else if (t.basis == Basis::sine || t.basis == Basis::cosine) {
          const S order = magnitude(t.argument);
          of = {order, order * order * order};
        } else if (t.basis == Basis::joint_position) {
          of.slope = S(1);
        }
        if (g == group::own) {
          third[t.place.body - 1U] += scale * of.third;
        } else {
          slope += scale * of.slope;
        }
      }
    }
    slope_square_ = slope * slope;
    for (std::size_t i = 0; i < N; ++i) third_square_[i] = third[i] * third[i] * S(1e4 / 36);
  }

  /// Square of a bound of the slope of all effects but the own ones and those of loads, rad (m) per rad.
  S slope_square() const { return slope_square_; }
  /// Square of a hundred times a bound of a sixth of the third derivative of joint i's own deflection, rad^-2.
  S third_square(std::size_t i) const { return third_square_[i]; }
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
  /// Bounds of first and third derivative.
  struct Derivatives {
    S slope, third;
  };

  static S magnitude(const S& x) { return x < S(0) ? -x : x; }

  /// Of a periodic cubic spline (M6): slopes lie between differences of coefficients that follow each other.
  static Derivatives of_curve(const S* c, const Table& table) {
    const std::size_t m = table.size;
    S first = S(0), third = S(0);
    for (std::size_t k = 0; k < m; ++k) {
      const S c0 = c[k], c1 = c[k + 1 < m ? k + 1 : k + 1 - m], c2 = c[k + 2 < m ? k + 2 : k + 2 - m],
              c3 = c[k + 3 < m ? k + 3 : k + 3 - m];
      const S d1 = magnitude(c1 - c0), d3 = magnitude(c3 - c0 + S(3) * (c1 - c2));
      if (d1 > first) first = d1;
      if (d3 > third) third = d3;
    }
    const S per_rad = S(static_cast<float>(table.size)) * S(0.15915494309189533577);
    return {first * per_rad, third * per_rad * per_rad * per_rad};
  }

  /// Of a grid (M7): all of its range between the two nodes that are closest, along both sides.
  static Derivatives of_grid(const S* nodes, const Table& table) {
    const S* v = nodes + table.rows + table.columns;
    S low = *v, high = *v;
    for (std::size_t k = 1; k < std::size_t{table.rows} * table.columns; ++k) {
      const S value = v[k];
      if (value < low) low = value;
      if (value > high) high = value;
    }
    const S range = high - low;
    return {over_least_distance(range, nodes, table.rows) +
                over_least_distance(range, nodes + table.rows, table.columns),
            S(0)};
  }
  static S over_least_distance(const S& change, const S* nodes, std::size_t count) {
    S greatest = S(0);
    for (std::size_t k = 1; k < count; ++k) {
      const S steep = change / (nodes[k] - nodes[k - 1]);
      if (steep > greatest) greatest = steep;
    }
    return greatest;
  }

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
  S slope_square_ = S(0);
  std::array<S, N> third_square_{};
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
