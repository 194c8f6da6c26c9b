// SPDX-License-Identifier: Apache-2.0
/// \file
/// Inverse compensation: the joint command that brings the flexible arm to the nominal pose of the command.
///
/// Bounded work whatever the input. Where the effects of a set only turn joints (Model::has_only_joint_deflections(), which all
/// sets of the paper's model are), the arm is a rigid chain behind joints that yield, and each is solved for itself:
///
/// 1. The nominal chain gives the pose to be reached and the Jacobian J. What the constant terms do to this pose is
///    carried along the chain to first order and solved for: the first correction.
/// 2. The chain with its constant terms says what that left. J x = rest is solved with the factored J and refined
///    against the chain's own axes, to second order. Where the first correction was so large that J has changed by a
///    tenth, or something had to be given up, J is factored anew and the chain passed once more instead.
/// 3. The chain's joints stand at psi = q + yield(q). The yield is taken around the chain, value and slope, then at
///    the reading itself until it stays.
///
/// All other sets take the forward model with its two passes as it is, three times: Newton, Newton, chord.
///
/// Near a singularity the arm gives up orientation before position (corrector.hpp). The map from command to correction
/// is continuous but for what one step more or less changes: 1e-9 rad where the arm is regular, and nowhere more
/// than core_compensation_test's bound on its slope through the singularities.
#ifndef FLEXCOMP_COMPENSATE_HPP
#define FLEXCOMP_COMPENSATE_HPP

#include <array>
#include <cmath>
#include <cstddef>

#include "flexcomp/bounds.hpp"
#include "flexcomp/detail/damped_jacobian_solver.hpp"
#include "flexcomp/detail/joint_deflection.hpp"
#include "flexcomp/detail/rigid_chain.hpp"
#include "flexcomp/forward.hpp"

namespace flexcomp {

template <class S, std::size_t N>
struct Compensated {
  std::array<S, N> q;  ///< corrected joint command, rad
  StepStatus status = StepStatus::refused;
};

namespace detail {

/// What one correction may turn any joint for the orientation, in parts of the largest correction. A regular
/// pose needs far less in the second and third; a stretched arm would use all it gets.
template <class S>
constexpr S allowed_turn(int correction) {
  return correction == 0 ? S(1) : correction == 1 ? S(0.2) : S(0.02);
}

/// False for a context with a NaN or an infinity in it.
template <class S, std::size_t N>
inline bool is_finite_context(const Context<S, N>& c) {
  FiniteCheck<S> check;
  check.add(c.payload_kg);
  check.add(c.temperature_c);
  check.add(c.time_s);
  check.add(c.payload_com_m);
  check.add(c.force_n);
  check.add(c.direction);
  check.add(c.relative_speed);
  return check.passed();
}

/// Where the flange and the tool point of the chain with constant terms are to be, in F0: the nominal pose
/// without B and without the tool's constant terms.
template <class S>
struct FlangeTarget {
  FlangePose<S> flange;
  Vec3<S> tool_point;
};

/// Turns the nominal pose, with which `aim` comes, into that.
template <class S, std::size_t N, class Cap>
inline void flange_target(const Model<S, N, Cap>& model, FlangeTarget<S>& aim) {
  Mat3<S>& axes = aim.flange.axes;
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
  aim.tool_point.x -= p[0];
  aim.tool_point.y -= p[1];
  aim.tool_point.z -= p[2];
  const Matrix3<S>& b = model.base_pose().rotation;
  const S xx = b(0, 0), xy = b(1, 0), xz = b(2, 0);
  const S yx = b(0, 1), yy = b(1, 1), yz = b(2, 1);
  const S zx = b(0, 2), zy = b(1, 2), zz = b(2, 2);
  for (Vec3<S>* v : {&axes.a, &axes.b, &axes.c, &aim.tool_point}) {
    const S x = v->x, y = v->y, z = v->z;
    v->x = xx * x + xy * y + xz * z;
    v->y = yx * x + yy * y + yz * z;
    v->z = zx * x + zy * y + zz * z;
  }
}

/// Corrections of the rigid chain at most: one from the nominal pose and two from the chain's own.
constexpr int most_corrections = 3;
/// Solutions of one linear problem after the first at most. Each leaves what the factored Jacobian is off by, some
/// 1e-2, of the one before.
constexpr int most_refinements = 3;
/// Evaluations of the yield after the first at most. Each leaves its slope, some 1e-3 on a stiff arm, of the one before.
constexpr int most_yield_steps = 6;

/// When a double or a float is accurate enough; squares of rad. `rough` and `bend` are estimates, good enough for a float
/// to leave something out; a double shows it always.
template <class S>
struct Tolerance {
  static constexpr S correction = S(1e-8);   ///< of the chain: the next one is a third-order rest of it
  static constexpr S rough = S(0);           ///< what a first solution of the linear problem leaves
  static constexpr S refinement = S(2e-20);  ///< what the next refinement would be
  static constexpr S bend = S(0);            ///< what the yield beside the chain leaves out
  static constexpr S yield_step = S(6e-20);  ///< what the next evaluation of the yield would change
};
template <>
struct Tolerance<float> {
  static constexpr float correction = 1e-6F;
  static constexpr float rough = 2.5e-13F;
  static constexpr float refinement = 1e-14F;
  static constexpr float bend = 1e-14F;
  static constexpr float yield_step = 1e-14F;
};

/// For sets whose effects all turn joints. The arm is then a rigid chain, whose joints stand at psi = q + yield(q):
/// psi is solved for first, without loads, and then q from it. `angle` comes with the nominal offsets, `aim` as the
/// nominal pose itself.
template <class S, std::size_t N, class Cap>
inline void correct_yielding_joints(const Model<S, N, Cap>& model, FlangeTarget<S>& aim,
                                    const Context<S, N>& context, std::array<SinCos<S>, N>& angle,
                                    DampedJacobianSolver<S, N>& corrector,
                                    const CompensationSettings<S>& settings, std::array<S, N>& q) {
  const S largest = settings.largest_correction_rad;
  std::array<S, N> dq;
  SmallMotion<S> move;
  // First what the constant terms do to the nominal chain, to first order.
  constant_twist(model, angle, move);
  {
    const SmallMotion<S>& base = model.base_twist();
    const Vec3<S> turn = {-move.angular.x - base.angular.x, -move.angular.y - base.angular.y,
                          -move.angular.z - base.angular.z};
    const S tx = aim.tool_point.x, ty = aim.tool_point.y, tz = aim.tool_point.z;
    const Vec3<S> shift = {turn.y * tz - turn.z * ty - move.linear.x - base.linear.x,
                           turn.z * tx - turn.x * tz - move.linear.y - base.linear.y,
                           turn.x * ty - turn.y * tx - move.linear.z - base.linear.z};
    corrector.solve(shift, turn, largest, largest, dq);
  }
  flange_target(model, aim);
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

  const bool loaded = model.yields_to_loads();
  const bool direct = model.own_count() + model.other_count() != 0;
  StaticLoad<S> load;
  std::array<S, N> yield;
  if (loaded) carried_load(model, context, load);
  std::array<JointAxis<S>, N> joints;
  FlangePose<S> flange;
  LinearisedDeflection<S, N> around;
  bool fresh = false;
  int k = 1;
  for (;; ++k) {
    rigid_pass(model.shapes(), angle, joints, flange);
    Vec3<S> point;
    flange_point(flange, vec3<S>(model.tool_pose().position), point);
    if (k == 1 && loaded) {
      if (load.is_plain) {
        around.set(model, q, joints, flange, load, yield);
      } else {
        // At the joint's angle instead of its reading: off by itself times its slope.
        load_deflection(model, q, angle, load, yield);
      }
    }
    const Vec3<S> shift = {aim.tool_point.x - point.x, aim.tool_point.y - point.y,
                           aim.tool_point.z - point.z};
    Vec3<S> turn;
    rotation_error(aim.flange.axes, flange.axes, turn);
    const S largest_turn = largest * allowed_turn<S>(k);
    // Beside a singularity the first correction can turn the wrist by 20 mrad, which changes the Jacobian by some
    // percent: from there on it is the one close to the solution.
    if (k == 1 && (corrector.is_damped() || corrector.jacobian_is_stale(turned))) {
      corrector.joints() = joints;
      corrector.set(point, settings);
      fresh = true;
    }
    S square = corrector.solve(shift, turn, largest, largest_turn, dq);
    // The factored Jacobian is off by about the turn over the smallest singular value, and the correction with it.
    bool done = fresh || turned * square <= Tolerance<S>::rough * corrector.regular();
    for (int n = 0; n < most_refinements && !done; ++n) {
      // The factored Jacobian is the nominal arm's, off by some 1e-2: what it leaves is solved for again, the second
      // order of the motion with it.
      motion(joints, point, dq, move);
      const Vec3<S> shift_left = {shift.x - move.linear.x, shift.y - move.linear.y, shift.z - move.linear.z};
      const Vec3<S> turn_left = {turn.x - move.angular.x, turn.y - move.angular.y, turn.z - move.angular.z};
      std::array<S, N> rest;
      const S left = corrector.solve(shift_left, turn_left, largest, largest_turn, rest);
      // Each of them leaves the same part of the one before.
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
    // Where something is given up the last correction decides how much, so there it is never left out.
    if (done && !corrector.is_damped() && square <= (fresh ? S(0.02) : S(1)) * Tolerance<S>::correction)
      break;
    rotate_all(angle, dq, square);
  }
  if (!loaded && !direct) return;
  if (!loaded) {
    for (S& y : yield) y = S(0);
  }

  // q was psi until here. Now it becomes the reading x with x + own(x) + yield(x) = psi; the angles lag by dq.
  if (direct) add_other_yield(model, q, context, yield);
  std::array<S, N> share;  // of a change of the yield that the reading takes
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) {
    const S y = yield[i];
    q[i] -= y;
    dq[i] -= y;
    share[i] = S(1);
  }
  if (model.own_count() != 0) take_own_yield(model, context, q, dq, share);
  if (loaded && load.is_plain) {
    std::array<S, N> change;
    around.change(model, joints, dq, change);
    FLEXCOMP_UNROLL
    for (std::size_t i = 0; i < N; ++i) {
      const S step = change[i] * share[i];
      yield[i] += change[i];
      q[i] -= step;
      dq[i] -= step;
    }
  }
  S square = square_of(dq);
  if (loaded && load.is_plain && k == 1 && model.other_count() == 0 && model.other_loaded_count() == 0) {
    // From this one chain the change above leaves out a wave's bend, of the wave's own size.
    if (square_of(yield) * square * square <= Tolerance<S>::bend) return;
  }
  for (int n = 0; n < most_yield_steps; ++n) {
    std::array<S, N> now;
    if (loaded) {
      rotate_all(angle, dq, square);
      load_deflection(model, q, angle, load, now);
    } else {
      for (S& y : now) y = S(0);
    }
    if (direct) add_other_yield(model, q, context, now);
    S size = S(0);
    square = S(0);
    FLEXCOMP_UNROLL
    for (std::size_t i = 0; i < N; ++i) {
      const S y = now[i];
      size += y * y;
      const S step = (yield[i] - y) * share[i];
      yield[i] = y;
      dq[i] = step;
      q[i] += step;
      square += step * step;
    }
    // What this step leaves is smaller by the slope, and the yield is a wave of some rad: its slope is like its size.
    if (square * size <= Tolerance<S>::yield_step) break;
  }
}

/// For all other sets: the forward model with its two passes, three times; Newton, Newton, chord.
template <class S, std::size_t N, class Cap>
inline void correct_general(const Model<S, N, Cap>& model, const Pose<S>& target,
                            const Context<S, N>& context, const CompensationSettings<S>& settings,
                            DampedJacobianSolver<S, N>& corrector, std::array<S, N>& q) {
  Workspace<S, N> ws;
  ws.q = q;
  for (std::size_t i = 0; i < N; ++i) ws.reading[i] = sin_cos(q[i]);
  const S largest = settings.largest_correction_rad;
  for (int k = 0; k < most_corrections; ++k) {
    const Pose<S> pose = evaluate(model, context, ws);
    Vec3<S> position = vec3<S>(target.position) - vec3<S>(pose.position);
    Vec3<S> orientation;
    rotation_error(columns_of(target.rotation), columns_of(pose.rotation), orientation);
    if (model.has_base()) {
      const Mat3<S> b = columns_of(model.base_pose().rotation);
      position = {dot(b.a, position), dot(b.b, position), dot(b.c, position)};
      orientation = {dot(b.a, orientation), dot(b.b, orientation), dot(b.c, orientation)};
    }
    if (k == 1) {
      // The first correction can turn the wrist by 20 mrad near a singularity, which changes the Jacobian by
      // some percent: from here on the chord is the deflected chain's own, close to the solution.
      for (std::size_t i = 0; i < N; ++i)
        corrector.joints()[i] = {vec3<S>(ws.frames.axis(i, 2)), vec3<S>(ws.frames.origin[i])};
      const Vec3<S> tool = vec3<S>(model.tool_pose().position);
      corrector.set(vec3<S>(ws.frames.origin[N]) + combine(columns_of(ws.frames.rotation[N]), tool),
                    settings);
    }
    std::array<S, N> dq;
    corrector.solve(position, orientation, largest, largest * allowed_turn<S>(k), dq);
    for (std::size_t i = 0; i < N; ++i) {
      ws.q[i] += dq[i];
      ws.reading[i] = rotate(ws.reading[i], dq[i]);
    }
  }
  q = ws.q;
}

}  // namespace detail

/// The joint command that brings the arm with all its terms to the pose that the nominal arm has at q_command
/// (rad).
///
/// The result is a pure function of its arguments. Refused (command passed through): a command that is not
/// finite or lies beyond a joint limit, a context that is not finite, and effects that grow beyond all bounds
/// (a joint deflected by more than 1e4 rad, a product that overflows). Otherwise the result is finite, within
/// the joint limits, and no joint differs from its command by more than settings.largest_correction_rad.
template <class S, std::size_t N, class Cap>
inline void compensate(const Model<S, N, Cap>& model, const std::array<S, N>& q_command,
                       const Context<S, N>& context, const CompensationSettings<S>& settings,
                       Compensated<S, N>& out) {
  const auto refuse = [&out, &q_command] {
    out.q = q_command;
    out.status = StepStatus::refused;
  };
  for (std::size_t i = 0; i < N; ++i) {
    if (!(q_command[i] >= model.lower(i) && q_command[i] <= model.upper(i))) return refuse();
  }
  // Asked here because a table holds its end values outside its nodes and would hide a NaN.
  if (!detail::is_finite_context(context)) return refuse();
  const S largest = settings.largest_correction_rad;
  std::array<SinCos<S>, N> angle;
  detail::sin_cos_all(q_command, model.nominals(), angle);
  detail::DampedJacobianSolver<S, N> corrector;
  detail::FlangeTarget<S> aim;
  detail::rigid_pass(model.nominals(), angle, corrector.joints(), aim.flange);
  detail::flange_point(aim.flange, vec3<S>(model.nominal_tool().position), aim.tool_point);
  corrector.set(aim.tool_point, settings);
  std::array<S, N> q;
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) q[i] = q_command[i];
  if (model.has_only_joint_deflections()) {
    detail::correct_yielding_joints(model, aim, context, angle, corrector, settings, q);
  } else {
    const Pose<S> target = nominal_forward(model, q_command);
    detail::correct_general(model, target, context, settings, corrector, q);
  }
  // Effects beyond all bounds end here, as a NaN, an infinity or a turn that no arm makes.
  S square = S(0);
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) {
    const S change = q[i] - q_command[i];
    square += change * change;
  }
  if (!(square < S(1e8))) return refuse();
  out.status = corrector.is_damped() ? StepStatus::near_singular : StepStatus::ok;
  if (square > largest * largest) {
    std::array<S, N> change;
    for (std::size_t i = 0; i < N; ++i) change[i] = q[i] - q_command[i];
    if (scale_to_limit(change, largest)) {
      out.status = StepStatus::limited;
      for (std::size_t i = 0; i < N; ++i) q[i] = q_command[i] + change[i];
    }
  }
  for (std::size_t i = 0; i < N; ++i) {
    S x = q[i];
    if (clamp_to(x, model.lower(i), model.upper(i))) out.status = StepStatus::at_limit;
    out.q[i] = x;
  }
}

/// The same by value.
template <class S, std::size_t N, class Cap>
inline Compensated<S, N> compensate(const Model<S, N, Cap>& model, const std::array<S, N>& q_command,
                                    const Context<S, N>& context,
                                    const CompensationSettings<S>& settings = {}) {
  Compensated<S, N> out;
  compensate(model, q_command, context, settings, out);
  return out;
}

/// What the flexible arm at q (rad) still misses of the pose that the nominal arm has at q_command.
template <class S>
struct TargetResidual {
  S position_m = S(0);
  S orientation_rad = S(0);  ///< sine of the angle, which is the angle to third order
};

template <class S, std::size_t N, class Cap>
inline TargetResidual<S> target_residual(const Model<S, N, Cap>& model, const std::array<S, N>& q,
                                         const std::array<S, N>& q_command, const Context<S, N>& context) {
  const Pose<S> target = nominal_forward(model, q_command);
  Workspace<S, N> ws;
  const Pose<S> pose = forward(model, q, context, ws);
  const Vector3<S> p = target.position - pose.position;
  Vec3<S> r;
  detail::rotation_error(columns_of(target.rotation), columns_of(pose.rotation), r);
  using std::sqrt;
  return {sqrt(dot<S>(p, p)), sqrt(dot(r, r))};
}

}  // namespace flexcomp

#endif
