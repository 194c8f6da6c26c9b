/// \file
/// Inverse compensation: the joint command that brings the flexible arm to the nominal pose of the command.
///
/// Bounded work whatever the input: one nominal pose, two Jacobians and their factorisations,
/// three corrections. J J^T is factored in 3x3 blocks, position first:
///
///     [P  Q^T] [u]   [e_p]        P = Jp Jp^T + lp^2 1,   Q = Jo Jp^T,
///     [Q  O  ] [v] = [e_o],       M = Jo Jo^T - Q P^-1 Q^T + lo^2 1,   dq = Jp^T u + Jo^T v
///
/// Both dampings are zero where the arm is regular. Near a singularity lo grows first and smoothly: the first
/// block row still holds exactly, so the arm gives up orientation before position. lp grows only where the
/// position itself cannot be reached. The correction is kept in two parts: what the position needs, and what
/// the orientation still needs without moving the tool point. Each is scaled down as a whole, never joint by
/// joint, and the second is allowed less from one correction to the next: so the last word is the position's,
/// also where a stretched arm could only chase its orientation for ever. The map from command to correction
/// is continuous everywhere.
#ifndef FLEXCOMP_COMPENSATE_HPP
#define FLEXCOMP_COMPENSATE_HPP

#include <array>
#include <cmath>
#include <cstddef>

#include "flexcomp/forward.hpp"
#include "flexcomp/joint_yield.hpp"
#include "flexcomp/rigid_chain.hpp"

namespace flexcomp {

/// Limits of the compensation. The defaults suit arms of 0.3 to 4 m whose errors are below 20 mm.
template <class S>
struct CompensationSettings {
  S largest_correction_rad = S(0.1);  ///< of any joint; a larger correction is scaled down as a whole
  /// Below this value of (trace of the inverse block)^-1/2, m/rad for position and 1 for orientation, damping
  /// sets in. An arm whose Jacobian has a smallest singular value of 0.1 (lengths in m) is never below
  /// 0.1/sqrt(3).
  S singular_below = S(0.05);
  S damping = S(0.1);  ///< at the singularity itself
};

template <class S, std::size_t N>
struct Compensated {
  std::array<S, N> q{};  ///< corrected joint command, rad
  StepStatus status = StepStatus::refused;
};

namespace detail {

/// Symmetric 3x3 matrix.
template <class S>
struct Symmetric {
  S xx, yy, zz, xy, xz, yz;

  Triple<S> operator*(const Triple<S>& v) const {
    return {xx * v.x + xy * v.y + xz * v.z, xy * v.x + yy * v.y + yz * v.z, xz * v.x + yz * v.y + zz * v.z};
  }
  Symmetric adjugate() const {
    return {yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy,
            xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz};
  }
};

/// Inverse of a symmetric positive block plus smooth damping. `regular` becomes 1 / trace(A^-1), never above the
/// square of the smallest singular value, where it was larger; below the square of settings.singular_below damping
/// sets in.
template <class S>
inline Symmetric<S> damped_inverse(Symmetric<S> a, const CompensationSettings<S>& settings, S& regular) {
  // 1 / trace(A^-1) = det(A) / trace(adj(A)) needs no division by a vanishing determinant.
  const S threshold = settings.singular_below * settings.singular_below;
  Symmetric<S> b = a.adjugate();
  const S trace = b.xx + b.yy + b.zz;
  S determinant = a.xx * b.xx + a.xy * b.xy + a.xz * b.xz;
  const S measure = trace > S(0) && determinant > S(0) ? determinant / trace : S(0);
  if (measure < regular) regular = measure;
  if (!(measure >= threshold)) {
    const S lack = S(1) - measure / threshold;
    const S lambda = settings.damping * settings.damping * lack * lack;
    a.xx += lambda;
    a.yy += lambda;
    a.zz += lambda;
    b = a.adjugate();
    determinant = a.xx * b.xx + a.xy * b.xy + a.xz * b.xz;
  }
  const S k = S(1) / determinant;
  return {b.xx * k, b.yy * k, b.zz * k, b.xy * k, b.xz * k, b.yz * k};
}

/// Largest magnitude in a list; NaNs are skipped.
template <class S, std::size_t N>
inline S greatest_of(const std::array<S, N>& v) {
  S greatest = S(0);
  for (const S x : v) {
    if (x > greatest) greatest = x;
    if (-x > greatest) greatest = -x;
  }
  return greatest;
}

template <class S, std::size_t N>
inline S square_of(const std::array<S, N>& v) {
  S sum = S(0);
  for (const S x : v) sum += x * x;
  return sum;
}

/// The factored Jacobian of one pose; every correction of a cycle uses it.
template <class S, std::size_t N>
class Corrector {
 public:
  /// Of the chain at the point `tool`, both in F0.
  void set(const std::array<JointAxis<S>, N>& joint, const Triple<S>& tool,
           const CompensationSettings<S>& settings) {
    regular_ = S(1);
    Symmetric<S> p = {S(0), S(0), S(0), S(0), S(0), S(0)};
    for (std::size_t i = 0; i < N; ++i) {
      const Triple<S> l = cross(joint[i].axis, tool - joint[i].origin);
      linear_[i] = l;
      p.xx += l.x * l.x;
      p.yy += l.y * l.y;
      p.zz += l.z * l.z;
      p.xy += l.x * l.y;
      p.xz += l.x * l.z;
      p.yz += l.y * l.z;
    }
    position_ = damped_inverse(p, settings, regular_);
    // Rows of Q = Jo Jp^T, and O = Jo Jo^T.
    ThreeTriples<S> q = {{S(0), S(0), S(0)}, {S(0), S(0), S(0)}, {S(0), S(0), S(0)}};
    for (std::size_t i = 0; i < N; ++i) {
      const Triple<S> l = linear_[i];
      const Triple<S> z = joint[i].axis;
      q.a.x += z.x * l.x;
      q.a.y += z.x * l.y;
      q.a.z += z.x * l.z;
      q.b.x += z.y * l.x;
      q.b.y += z.y * l.y;
      q.b.z += z.y * l.z;
      q.c.x += z.z * l.x;
      q.c.y += z.z * l.y;
      q.c.z += z.z * l.z;
    }
    Symmetric<S> o = {S(0), S(0), S(0), S(0), S(0), S(0)};
    for (std::size_t i = 0; i < N; ++i) {
      const Triple<S> z = joint[i].axis;
      angular_[i] = z;
      o.xx += z.x * z.x;
      o.yy += z.y * z.y;
      o.zz += z.z * z.z;
      o.xy += z.x * z.y;
      o.xz += z.x * z.z;
      o.yz += z.y * z.z;
    }
    gain_.a = position_ * q.a;
    gain_.b = position_ * q.b;
    gain_.c = position_ * q.c;
    o.xx -= dot(gain_.a, q.a);
    o.xy -= dot(gain_.a, q.b);
    o.xz -= dot(gain_.a, q.c);
    o.yy -= dot(gain_.b, q.b);
    o.yz -= dot(gain_.b, q.c);
    o.zz -= dot(gain_.c, q.c);
    orientation_ = damped_inverse(o, settings, regular_);
    if (!(regular_ >= settings.singular_below * settings.singular_below)) gave_up_ = true;
  }

  /// Whether any correction so far was damped or scaled down.
  bool gave_up() const { return gave_up_; }
  /// True where the joints have turned so far since set() that the factored Jacobian is a tenth off or more.
  bool is_worn_by(const std::array<S, N>& dq) const { return !(square_of(dq) <= S(0.01) * regular_); }

  /// Joint correction for a position error (m) and a small orientation error (rad), both in F0: what the
  /// position needs, no joint more than `largest`, plus what the orientation still needs while the tool point
  /// stays, no joint more than `largest_turn` (rad).
  void solve(const Triple<S>& position, const Triple<S>& orientation, S largest, S largest_turn,
             std::array<S, N>& dq) {
    Triple<S> u = position_ * position;
    const Triple<S> rest = orientation - Triple<S>{dot(gain_.a, position), dot(gain_.b, position), dot(gain_.c, position)};
    const Triple<S> v = orientation_ * rest;
    const Triple<S> w = combine(gain_, v);  // gain_ has rows: this is its transpose times v
    // |shift|^2 <= u . position and |turn|^2 <= v . rest: nearly always nothing has to be scaled down.
    if (!(dot(u, position) <= largest * largest && dot(v, rest) <= largest_turn * largest_turn)) {
      solve_held(u, v, w, largest, largest_turn, dq);
      return;
    }
    u = u - w;
    for (std::size_t i = 0; i < N; ++i) dq[i] = dot(linear_[i], u) + dot(angular_[i], v);
  }

 private:
  void solve_held(const Triple<S>& u, const Triple<S>& v, const Triple<S>& w, S largest, S largest_turn,
                  std::array<S, N>& dq) {
    std::array<S, N> turn;
    for (std::size_t i = 0; i < N; ++i) {
      dq[i] = dot(linear_[i], u);
      turn[i] = dot(angular_[i], v) - dot(linear_[i], w);
    }
    if (hold_below(dq, largest)) gave_up_ = true;
    if (hold_below(turn, largest_turn)) gave_up_ = true;
    for (std::size_t i = 0; i < N; ++i) dq[i] += turn[i];
  }
  static bool hold_below(std::array<S, N>& v, S largest) {
    const S greatest = greatest_of(v);
    if (!(greatest > largest)) return false;
    const S scale = largest / greatest;
    for (S& x : v) x *= scale;
    return true;
  }

  std::array<Triple<S>, N> linear_;
  std::array<Triple<S>, N> angular_;
  Symmetric<S> position_;
  Symmetric<S> orientation_;
  ThreeTriples<S> gain_;  ///< rows of Q P^-1
  S regular_ = S(0);
  bool gave_up_ = false;
};

/// sin(angle) * axis of the rotation that turns `from` into `to` (columns), in the outer frame; exact to third
/// order.
template <class S>
inline Triple<S> rotation_error(const ThreeTriples<S>& to, const ThreeTriples<S>& from) {
  return {S(0.5) * (from.a.y * to.a.z - from.a.z * to.a.y + from.b.y * to.b.z - from.b.z * to.b.y +
                    from.c.y * to.c.z - from.c.z * to.c.y),
          S(0.5) * (from.a.z * to.a.x - from.a.x * to.a.z + from.b.z * to.b.x - from.b.x * to.b.z +
                    from.c.z * to.c.x - from.c.x * to.c.z),
          S(0.5) * (from.a.x * to.a.y - from.a.y * to.a.x + from.b.x * to.b.y - from.b.y * to.b.x +
                    from.c.x * to.c.y - from.c.y * to.c.x)};
}

/// How the tool point and the rotation move when the joints turn by dq: the Jacobian of this chain times dq.
template <class S>
struct Motion {
  Triple<S> linear;
  Triple<S> angular;
};
template <class S, std::size_t N>
inline Motion<S> motion(const std::array<JointAxis<S>, N>& joint, const Triple<S>& tool,
                        const std::array<S, N>& dq) {
  Triple<S> turn = {S(0), S(0), S(0)};
  Triple<S> at_zero = {S(0), S(0), S(0)};  // of the point that lies at the origin of F0
  for (std::size_t i = 0; i < N; ++i) {
    const Triple<S> w = joint[i].axis * dq[i];
    const Triple<S>& p = joint[i].origin;
    turn = turn + w;
    at_zero.x += p.y * w.z;
    at_zero.x -= p.z * w.y;
    at_zero.y += p.z * w.x;
    at_zero.y -= p.x * w.z;
    at_zero.z += p.x * w.y;
    at_zero.z -= p.y * w.x;
  }
  return {at_zero + cross(turn, tool), turn};
}

/// What one correction may turn any joint for the orientation, in parts of the largest correction. A regular
/// pose needs far less in the second and third; a stretched arm would use all it gets.
template <class S>
constexpr S allowed_turn(int correction) {
  return correction == 0 ? S(1) : correction == 1 ? S(0.2) : S(0.02);
}

/// False for a context with a NaN or an infinity in it: 0 * x is 0 for all other numbers.
template <class S, std::size_t N>
inline bool is_finite_context(const Context<S, N>& c) {
  S zero = S(0) * c.payload_kg + S(0) * c.temperature_c + S(0) * c.time_s;
  for (std::size_t k = 0; k < 3; ++k) zero += S(0) * c.payload_com_m[k] + S(0) * c.force_n[k];
  for (std::size_t i = 0; i < N; ++i) zero += S(0) * c.direction[i] + S(0) * c.relative_speed[i];
  return zero <= S(0);
}

/// Where the flange and the tool point of the chain with constant terms are to be, in F0: the nominal pose
/// without B and without the tool's constant terms.
template <class S>
struct Aim {
  ThreeTriples<S> flange;
  Triple<S> tool_point;
};

template <class S, std::size_t N, class Cap>
inline Aim<S> aim_of(const Model<S, N, Cap>& model, const RigidChain<S, N>& nominal, const Triple<S>& tool_point) {
  Aim<S> aim = {nominal.flange, tool_point};
  if (model.turns_tool()) {
    const ThreeTriples<S> turn = columns_of(model.tool_turn());
    aim.flange = {combine(nominal.flange, turn.a), combine(nominal.flange, turn.b), combine(nominal.flange, turn.c)};
  }
  if (model.has_base()) {
    const ThreeTriples<S> b = columns_of(model.base_pose().rotation);
    const auto back = [&b](const Triple<S>& v) { return Triple<S>{dot(b.a, v), dot(b.b, v), dot(b.c, v)}; };
    aim.flange = {back(aim.flange.a), back(aim.flange.b), back(aim.flange.c)};
    aim.tool_point = back(aim.tool_point - triple<S>(model.base_pose().position));
  }
  return aim;
}

template <class S, std::size_t N>
inline void rotate_all(std::array<SinCos<S>, N>& angle, const std::array<S, N>& by) {
  for (std::size_t i = 0; i < N; ++i) angle[i] = rotate(angle[i], by[i]);
}

/// What turns joints without frames and not by their own reading alone.
template <class S, std::size_t N, class Cap>
inline void add_other_yield(const Model<S, N, Cap>& model, const std::array<S, N>& q, const Context<S, N>& context,
                            std::array<S, N>& yield) {
  for (std::size_t k = 0; k < model.other_count(); ++k) {
    const Term<S>& term = model.other_term(k);
    yield[term.place.body - 1U] += term.coefficient * plain_basis_value(model, term, context, q);
  }
}

/// Corrections of the rigid chain at most; the third only where the second was still large.
constexpr int most_corrections = 3;
/// A correction whose square sum is below this (rad^2) leaves less than 1e-9 rad by what a Newton step leaves, half
/// its own square.
template <class S>
constexpr S small_correction = S(6e-10);
/// Evaluations of the yield after the first at most. Each gains a factor of its slope, some 1e-3 on a stiff arm.
constexpr int most_yield_steps = 6;
template <class S>
constexpr S small_yield_step = S(1e-14);  ///< rad^2

/// For sets whose effects all turn joints. The arm is then a rigid chain, whose joints stand at psi = q + yield(q):
/// psi is solved for first, without loads, and then q from it. Leaves q, and whether the work was bounded by giving
/// something up in the corrector.
template <class S, std::size_t N, class Cap>
inline void correct_yielding_joints(const Model<S, N, Cap>& model, const Aim<S>& aim, const Context<S, N>& context,
                                    std::array<SinCos<S>, N>& angle, Corrector<S, N>& corrector,
                                    const CompensationSettings<S>& settings,
                                    RigidChain<S, N>& chain, std::array<S, N>& q) {
  for (std::size_t i = 0; i < N; ++i) angle[i] = compose(angle[i], model.shape(i).offset);
  const bool loaded = model.yields_to_loads() || model.lever_count() != 0;
  const CarriedLoad<S> load = carried_load(model, context);
  std::array<S, N> yield{};
  // Taken at the command, some milliradians off: its own error is that times its slope, 1e-5 rad.
  if (loaded) loaded_yield(model, q, angle, load, yield);

  const Triple<S> tool = triple<S>(model.tool_pose().position);
  const S largest = settings.largest_correction_rad;
  std::array<S, N> dq;
  bool fresh = false;
  for (int k = 0; k < most_corrections; ++k) {
    rigid_pass(model.shapes(), angle, chain);
    const Triple<S> point = chain.end + combine(chain.flange, tool);
    Triple<S> position = aim.tool_point - point;
    Triple<S> orientation = rotation_error(aim.flange, chain.flange);
    const S turn = largest * allowed_turn<S>(k);
    // Beside a singularity the first correction can turn the wrist by 20 mrad, which changes the Jacobian by some
    // percent: from there on it is the one close to the solution.
    if (k == 1 && (corrector.gave_up() || corrector.is_worn_by(dq))) {
      corrector.set(chain.joint, point, settings);
      fresh = true;
    }
    corrector.solve(position, orientation, largest, turn, dq);
    bool done = k > 0;
    if (k > 0 && !fresh) {
      // The factored Jacobian is the nominal arm's at the command, off by some 1e-3: what it leaves of the linear
      // problem here is solved for once more.
      const Motion<S> reached = motion(chain.joint, point, dq);
      std::array<S, N> rest;
      corrector.solve(position - reached.linear, orientation - reached.angular, largest, turn, rest);
      // Each of these solutions leaves the same part of the one before.
      const S square = square_of(rest);
      done = square * square <= S(1e-19) * square_of(dq);
      for (std::size_t i = 0; i < N; ++i) dq[i] += rest[i];
    }
    for (std::size_t i = 0; i < N; ++i) q[i] += dq[i];
    rotate_all(angle, dq);
    // Where something is given up the last correction decides how much, so there it is never left out.
    if (done && !corrector.gave_up() && square_of(dq) <= small_correction<S>) break;
  }

  // q was psi until here. Now it becomes the reading x with x + own(x) + yield(x) = psi.
  const bool direct = model.own_count() + model.other_count() != 0;
  if (!loaded && !direct) return;
  if (direct) add_other_yield(model, q, context, yield);
  std::array<S, N> share;  // of a change of the yield that the reading takes
  for (std::size_t i = 0; i < N; ++i) {
    share[i] = S(1);
    dq[i] = -yield[i];
  }
  if (model.own_count() != 0) {
    std::array<S, N> at;
    std::array<Local<S>, N> own{};
    for (std::size_t i = 0; i < N; ++i) at[i] = q[i] - yield[i];
    for (std::size_t k = 0; k < model.own_count(); ++k) {
      const Term<S>& term = model.own_term(k);
      const Local<S> here = own_yield(model, term, at[term.joint], context);
      Local<S>& sum = own[term.joint];
      sum.value += here.value;
      sum.slope += here.slope;
      sum.half_curvature += here.half_curvature;
    }
    for (std::size_t i = 0; i < N; ++i) {
      share[i] = S(1) / (S(1) + own[i].slope);
      const S newton = own[i].value * share[i];
      dq[i] -= newton + own[i].half_curvature * newton * newton * share[i];
    }
  }
  for (std::size_t i = 0; i < N; ++i) q[i] += dq[i];
  for (int k = 0; k < most_yield_steps; ++k) {
    rotate_all(angle, dq);
    std::array<S, N> now{};
    if (loaded) loaded_yield(model, q, angle, load, now);
    if (direct) add_other_yield(model, q, context, now);
    for (std::size_t i = 0; i < N; ++i) {
      dq[i] = (yield[i] - now[i]) * share[i];
      q[i] += dq[i];
    }
    yield = now;
    if (k > 0 && square_of(dq) < small_yield_step<S>) break;
  }
}

/// For all other sets: the forward model with its two passes, three times; Newton, Newton, chord.
template <class S, std::size_t N, class Cap>
inline void correct_any(const Model<S, N, Cap>& model, const Pose<S>& target, const Context<S, N>& context,
                        const std::array<SinCos<S>, N>& reading, const CompensationSettings<S>& settings,
                        Corrector<S, N>& corrector, std::array<S, N>& q) {
  Workspace<S, N> ws;
  ws.q = q;
  ws.reading = reading;
  const S largest = settings.largest_correction_rad;
  for (int k = 0; k < most_corrections; ++k) {
    const Pose<S> pose = evaluate(model, context, ws);
    Triple<S> position = triple<S>(target.position) - triple<S>(pose.position);
    Triple<S> orientation = rotation_error(columns_of(target.rotation), columns_of(pose.rotation));
    if (model.has_base()) {
      const ThreeTriples<S> b = columns_of(model.base_pose().rotation);
      position = {dot(b.a, position), dot(b.b, position), dot(b.c, position)};
      orientation = {dot(b.a, orientation), dot(b.b, orientation), dot(b.c, orientation)};
    }
    if (k == 1) {
      // The first correction can turn the wrist by 20 mrad near a singularity, which changes the Jacobian by
      // some percent: from here on the chord is the deflected chain's own, close to the solution.
      std::array<JointAxis<S>, N> joint;
      for (std::size_t i = 0; i < N; ++i)
        joint[i] = {triple<S>(ws.frames.axis(i, 2)), triple<S>(ws.frames.origin[i])};
      const Triple<S> tool = triple<S>(model.tool_pose().position);
      corrector.set(joint, triple<S>(ws.frames.origin[N]) + combine(columns_of(ws.frames.rotation[N]), tool), settings);
    }
    std::array<S, N> dq;
    corrector.solve(position, orientation, largest, largest * allowed_turn<S>(k), dq);
    for (std::size_t i = 0; i < N; ++i) ws.q[i] += dq[i];
    rotate_all(ws.reading, dq);
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
inline Compensated<S, N> compensate(const Model<S, N, Cap>& model, const std::array<S, N>& q_command,
                                    const Context<S, N>& context,
                                    const CompensationSettings<S>& settings = {}) {
  Compensated<S, N> out;
  out.q = q_command;
  for (std::size_t i = 0; i < N; ++i) {
    if (!(q_command[i] >= model.lower(i) && q_command[i] <= model.upper(i))) return out;
  }
  // Asked here because a table holds its end values outside its nodes and would hide a NaN.
  if (!detail::is_finite_context(context)) return out;
  const S largest = settings.largest_correction_rad;
  std::array<SinCos<S>, N> reading;
  std::array<SinCos<S>, N> angle;
  for (std::size_t i = 0; i < N; ++i) {
    reading[i] = sin_cos(q_command[i]);
    angle[i] = compose(reading[i], model.nominal(i).offset);
  }
  detail::RigidChain<S, N> chain;
  detail::rigid_pass(model.nominals(), angle, chain);
  const Triple<S> tool_point =
      chain.end + combine(chain.flange, triple<S>(model.nominal_tool().position));
  detail::Corrector<S, N> corrector;
  corrector.set(chain.joint, tool_point, settings);
  std::array<S, N> q = q_command;
  if (model.only_joints_yield()) {
    const detail::Aim<S> aim = detail::aim_of(model, chain, tool_point);
    detail::correct_yielding_joints(model, aim, context, reading, corrector, settings, chain, q);
  } else {
    const Pose<S> target = nominal_forward(model, q_command);
    detail::correct_any(model, target, context, reading, settings, corrector, q);
  }
  std::array<S, N> change;
  for (std::size_t i = 0; i < N; ++i) change[i] = q[i] - q_command[i];
  // Effects beyond all bounds end here, as a NaN, an infinity or a turn that no arm makes.
  const S square = detail::square_of(change);
  if (!(square < S(1e8))) return out;
  out.status = corrector.gave_up() ? StepStatus::near_singular : StepStatus::ok;
  if (square > largest * largest) {
    const S greatest = detail::greatest_of(change);
    if (greatest > largest) {
      out.status = StepStatus::limited;
      const S scale = largest / greatest;
      for (std::size_t i = 0; i < N; ++i) q[i] = q_command[i] + change[i] * scale;
    }
  }
  for (std::size_t i = 0; i < N; ++i) {
    if (q[i] < model.lower(i)) {
      q[i] = model.lower(i);
      out.status = StepStatus::at_limit;
    } else if (q[i] > model.upper(i)) {
      q[i] = model.upper(i);
      out.status = StepStatus::at_limit;
    }
  }
  out.q = q;
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
  const Triple<S> r =
      detail::rotation_error(columns_of(target.rotation), columns_of(pose.rotation));
  using std::sqrt;
  return {sqrt(dot<S>(p, p)), sqrt(dot(r, r))};
}

}  // namespace flexcomp

#endif
