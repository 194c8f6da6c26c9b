// SPDX-License-Identifier: Apache-2.0
/// \file
/// Compensation of sets whose effects all turn joints (docs/compensation.md, sections 2 and 4).
///
/// 1. The nominal chain gives the target pose and the Jacobian J. The constant terms are one twist to first
///    order, and its solution is the first correction (C3).
/// 2. The chain with its constant terms gives the remaining error (C5). It is solved with the factored J and
///    refined to second order (C6), or J is factored anew where it has changed by a tenth.
/// 3. The chain's joints stand at psi = q + delta(q) (C2): q is solved for by (C13) to (C15).
#ifndef FLEXCOMP_DETAIL_JOINT_ONLY_PATH_HPP
#define FLEXCOMP_DETAIL_JOINT_ONLY_PATH_HPP

#include <array>
#include <cstddef>

#include "flexcomp/bounds.hpp"
#include "flexcomp/detail/damped_jacobian_solver.hpp"
#include "flexcomp/detail/joint_deflection.hpp"
#include "flexcomp/detail/rigid_chain.hpp"

namespace flexcomp {
namespace detail {

/// Target of the flange and the tool point of the chain with constant terms, in F0 (C4): the nominal pose
/// without B and without the tool's constant terms.
template <class S>
struct FlangeTarget {
  FlangePose<S> flange;
  Vec3<S> tool_point;
};

/// Turns a nominal pose into the target (C4), in place.
template <class S, std::size_t N, class Cap>
inline void flange_target(const Model<S, N, Cap>& model, FlangeTarget<S>& target) {
  Mat3<S>& axes = target.flange.axes;
  if (model.turns_tool()) {
    const Mat3<S> nominal = axes;
    int k = 0;
    for (Vec3<S>* v : {&axes.a, &axes.b, &axes.c}) {
      const Vec3<S> turn = vec3<S>(model.tool_turn().col(k++));
      *v = combine(nominal, turn);
    }
  }
  if (!model.has_base()) return;
  const Vector3<S>& p = model.base_pose().position;
  target.tool_point.x -= p[0];
  target.tool_point.y -= p[1];
  target.tool_point.z -= p[2];
  const Matrix3<S>& b = model.base_pose().rotation;
  const S xx = b(0, 0), xy = b(1, 0), xz = b(2, 0);
  const S yx = b(0, 1), yy = b(1, 1), yz = b(2, 1);
  const S zx = b(0, 2), zy = b(1, 2), zz = b(2, 2);
  for (Vec3<S>* v : {&axes.a, &axes.b, &axes.c, &target.tool_point}) {
    const S x = v->x, y = v->y, z = v->z;
    v->x = xx * x + xy * y + xz * z;
    v->y = yx * x + yy * y + yz * z;
    v->z = zx * x + zy * y + zz * z;
  }
}

/// Most refinements of a linear solution (C6). The error of the factored Jacobian, some 1e-2, is the ratio of
/// each remainder to the one before.
constexpr int most_refinements = 3;
/// Most fixed-point steps of the deflection (C15). Its slope, some 1e-3 on a stiff arm, is the ratio of each
/// remainder to the one before.
constexpr int most_deflection_steps = 6;

/// Ends of the iterations (C7), squares of rad. By the estimates `first_solution` and `linearised` a float
/// may leave a step out; at 0 a double never does.
template <class S>
struct Tolerance {
  static constexpr S correction = S(1e-8);        ///< of the chain: the next one is of third order in it
  static constexpr S first_solution = S(0);       ///< remainder of the first linear solution
  static constexpr S refinement = S(2e-20);       ///< size of the next refinement
  static constexpr S linearised = S(0);           ///< what the linearised deflection leaves out
  static constexpr S deflection_step = S(6e-20);  ///< change by the next evaluation of the deflection
};
template <>
struct Tolerance<float> {
  static constexpr float correction = 1e-6F;
  static constexpr float first_solution = 2.5e-13F;
  static constexpr float refinement = 1e-14F;
  static constexpr float linearised = 1e-14F;
  static constexpr float deflection_step = 1e-14F;
};

/// Corrected command q (rad) of a set whose effects all turn joints: psi by the rigid inverse, then q from it
/// (C2). On entry `angle` has the nominal offsets, `target` is the nominal pose, the solver holds the nominal
/// Jacobian and q is the command. Work: at most 2 chain passes, 1 factorisation, 9 linear solutions and 7
/// deflections.
template <class S, std::size_t N, class Cap>
inline void correct_joint_deflections(const Model<S, N, Cap>& model, FlangeTarget<S>& target,
                                      const Context<S, N>& context, std::array<SinCos<S>, N>& angle,
                                      DampedJacobianSolver<S, N>& solver,
                                      const CompensationSettings<S>& settings,
                                      const SingularRegion<S>& region, std::array<S, N>& q) {
  const S largest = settings.largest_correction_rad;
  std::array<S, N> dq;
  SmallMotion<S> move;
  // First correction: the constant terms as one twist (C3).
  constant_twist(model, angle, move);
  {
    const SmallMotion<S>& base = model.base_twist();
    const Vec3<S> turn = {-move.angular.x - base.angular.x, -move.angular.y - base.angular.y,
                          -move.angular.z - base.angular.z};
    const S tx = target.tool_point.x, ty = target.tool_point.y, tz = target.tool_point.z;
    const Vec3<S> shift = {turn.y * tz - turn.z * ty - move.linear.x - base.linear.x,
                           turn.z * tx - turn.x * tz - move.linear.y - base.linear.y,
                           turn.x * ty - turn.y * tx - move.linear.z - base.linear.z};
    solver.solve(shift, turn, largest, largest, dq);
  }
  flange_target(model, target);
  std::array<S, N> by;
  S turned = S(0);
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) {
    const S d = dq[i];
    q[i] += d;
    const S b = d + model.constant_theta(i);
    by[i] = b;
    turned += b * b;
  }
  rotate_all(angle, by, turned);

  const bool loaded = model.has_load_deflections();
  const bool direct = model.own_count() + model.other_count() != 0;
  StaticLoad<S> load;
  std::array<S, N> deflection;
  if (loaded) static_load(model, context, load);
  std::array<JointAxis<S>, N> joints;
  FlangePose<S> flange;
  LinearisedDeflection<S, N> linearised;
  bool fresh = false;
  int k = 1;
  for (;; ++k) {
    rigid_pass(model.shapes(), angle, joints, flange);
    Vec3<S> point;
    flange_point(flange, vec3<S>(model.tool_pose().position), point);
    if (k == 1 && loaded) {
      if (load.is_plain) {
        linearised.set(model, q, joints, flange, load, deflection);
      } else {
        // At the joint angle instead of the reading: the error is the deflection times its slope.
        load_deflection(model, q, angle, load, deflection);
      }
    }
    const Vec3<S> shift = {target.tool_point.x - point.x, target.tool_point.y - point.y,
                           target.tool_point.z - point.z};
    Vec3<S> turn;
    rotation_error(target.flange.axes, flange.axes, turn);
    const S largest_turn = largest * allowed_turn<S>(k);
    // Near a singularity the first correction can turn the wrist by 20 mrad, which changes the Jacobian by
    // some percent: from there on the Jacobian of this chain is used, which is close to that of the solution.
    if (k == 1 && (solver.is_damped() || solver.jacobian_is_stale(turned))) {
      solver.joints() = joints;
      solver.set(point, region);
      fresh = true;
    }
    S square = solver.solve(shift, turn, largest, largest_turn, dq);
    // The relative error of the factored Jacobian, and of the correction, is about the turn over the smallest
    // singular value.
    bool done = fresh || turned * square <= Tolerance<S>::first_solution * solver.regular();
    for (int n = 0; n < most_refinements && !done; ++n) {
      // The factored Jacobian is the nominal arm's, with a relative error of some 1e-2: the remainder, with
      // the second order of the motion (C6), is solved for again.
      motion(joints, point, dq, move);
      const Vec3<S> shift_left = {shift.x - move.linear.x, shift.y - move.linear.y, shift.z - move.linear.z};
      const Vec3<S> turn_left = {turn.x - move.angular.x, turn.y - move.angular.y, turn.z - move.angular.z};
      std::array<S, N> rest;
      const S left = solver.solve(shift_left, turn_left, largest, largest_turn, rest);
      // The remainders are a geometric sequence.
      done = left * left <= Tolerance<S>::refinement * square;
      square = S(0);
      FLEXCOMP_UNROLL
      for (std::size_t i = 0; i < N; ++i) {
        const S d = dq[i] + rest[i];
        dq[i] = d;
        square += d * d;
      }
    }
    FLEXCOMP_UNROLL
    for (std::size_t i = 0; i < N; ++i) q[i] += dq[i];
    if (k == most_corrections - 1) break;
    // Where the solution is damped, the last correction decides how much of the error remains: it is never
    // left out.
    if (done && !solver.is_damped() && square <= (fresh ? S(0.02) : S(1)) * Tolerance<S>::correction) break;
    rotate_all(angle, dq, square);
  }
  if (!loaded && !direct) return;
  if (!loaded) {
    for (S& y : deflection) y = S(0);
  }

  // Until here q was psi. From here it is the reading x of (C11); `angle` lags behind it by dq.
  if (direct) add_other_deflections(model, q, context, deflection);
  std::array<S, N> share;  // w of (C15): change of the reading per change of the deflection
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) {
    const S y = deflection[i];
    q[i] -= y;
    dq[i] -= y;
    share[i] = S(1);
  }
  if (model.own_count() != 0) subtract_own_deflections(model, context, q, dq, share);
  if (loaded && load.is_plain) {
    std::array<S, N> change;
    linearised.change(model, joints, dq, change);
    FLEXCOMP_UNROLL
    for (std::size_t i = 0; i < N; ++i) {
      const S step = change[i] * share[i];
      deflection[i] += change[i];
      q[i] -= step;
      dq[i] -= step;
    }
  }
  S square = square_of(dq);
  if (loaded && load.is_plain && k == 1 && model.other_count() == 0 && model.other_loaded_count() == 0) {
    // The linearised change leaves out the curvature of the deflection, which is of the size of the
    // deflection (sines of some rad).
    if (square_of(deflection) * square * square <= Tolerance<S>::linearised) return;
  }
  for (int n = 0; n < most_deflection_steps; ++n) {
    std::array<S, N> now;
    if (loaded) {
      rotate_all(angle, dq, square);
      load_deflection(model, q, angle, load, now);
    } else {
      for (S& y : now) y = S(0);
    }
    if (direct) add_other_deflections(model, q, context, now);
    S size = S(0);
    square = S(0);
    FLEXCOMP_UNROLL
    for (std::size_t i = 0; i < N; ++i) {
      const S y = now[i];
      size += y * y;
      const S step = (deflection[i] - y) * share[i];
      deflection[i] = y;
      dq[i] = step;
      q[i] += step;
      square += step * step;
    }
    // The remainder is smaller by the slope, which for sines of some rad is of the size of the deflection
    // itself.
    if (square * size <= Tolerance<S>::deflection_step) break;
  }
}

}  // namespace detail
}  // namespace flexcomp

#endif
