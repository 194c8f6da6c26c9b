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

/// Inverse of a symmetric positive 3x3 block plus smooth damping. Returns whether damping was needed.
template <class S>
struct DampedInverse {
  Matrix3<S> inverse;
  bool damped = false;

  void set(Matrix3<S> a, const CompensationSettings<S>& settings) {
    // 1 / trace(A^-1) = det(A) / trace(adj(A)) needs no division by a vanishing determinant.
    const S threshold = settings.singular_below * settings.singular_below;
    adjugate(a);
    const S trace = inverse(0, 0) + inverse(1, 1) + inverse(2, 2);
    S determinant = a(0, 0) * inverse(0, 0) + a(0, 1) * inverse(1, 0) + a(0, 2) * inverse(2, 0);
    damped = !(determinant >= threshold * trace);
    if (damped) {
      const S measure = trace > S(0) && determinant > S(0) ? determinant / trace : S(0);
      const S lack = S(1) - measure / threshold;
      const S lambda = settings.damping * settings.damping * lack * lack;
      for (int k = 0; k < 3; ++k) a(k, k) += lambda;
      adjugate(a);
      determinant = a(0, 0) * inverse(0, 0) + a(0, 1) * inverse(1, 0) + a(0, 2) * inverse(2, 0);
    }
    inverse *= S(1) / determinant;
  }

 private:
  void adjugate(const Matrix3<S>& a) {
    inverse(0, 0) = a(1, 1) * a(2, 2) - a(1, 2) * a(1, 2);
    inverse(1, 1) = a(0, 0) * a(2, 2) - a(0, 2) * a(0, 2);
    inverse(2, 2) = a(0, 0) * a(1, 1) - a(0, 1) * a(0, 1);
    inverse(0, 1) = inverse(1, 0) = a(0, 2) * a(1, 2) - a(0, 1) * a(2, 2);
    inverse(0, 2) = inverse(2, 0) = a(0, 1) * a(1, 2) - a(0, 2) * a(1, 1);
    inverse(1, 2) = inverse(2, 1) = a(0, 1) * a(0, 2) - a(0, 0) * a(1, 2);
  }
};

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

/// The factored Jacobian of one pose; every correction of a cycle uses it (chord iteration).
template <class S, std::size_t N>
class Corrector {
 public:
  void set(const Frames<S, N>& frames, const Vector3<S>& tool, const CompensationSettings<S>& settings) {
    Matrix3<S> p = Matrix3<S>::Zero();
    Matrix3<S> o = Matrix3<S>::Zero();
    Matrix3<S> q = Matrix3<S>::Zero();
    for (std::size_t i = 0; i < N; ++i) {
      angular_[i] = frames.axis(i, 2);
      linear_[i] = cross<S>(angular_[i], tool - frames.origin[i]);
      for (int c = 0; c < 3; ++c) {
        for (int r = 0; r <= c; ++r) {
          p(r, c) += linear_[i][r] * linear_[i][c];
          o(r, c) += angular_[i][r] * angular_[i][c];
        }
        for (int r = 0; r < 3; ++r) q(r, c) += angular_[i][r] * linear_[i][c];
      }
    }
    mirror(p);
    position_.set(p, settings);
    for (int c = 0; c < 3; ++c) {
      for (int r = 0; r < 3; ++r) {
        gain_(r, c) = q(r, 0) * position_.inverse(0, c) + q(r, 1) * position_.inverse(1, c) +
                      q(r, 2) * position_.inverse(2, c);
      }
    }
    for (int c = 0; c < 3; ++c) {
      for (int r = 0; r <= c; ++r) {
        o(r, c) -= gain_(r, 0) * q(c, 0) + gain_(r, 1) * q(c, 1) + gain_(r, 2) * q(c, 2);
      }
    }
    mirror(o);
    orientation_.set(o, settings);
    if (position_.damped || orientation_.damped) gave_up_ = true;
  }

  /// Whether any correction so far was damped or scaled down.
  bool gave_up() const { return gave_up_; }

  /// Joint correction for a position error (m) and a small orientation error (rad), both in F0: what the
  /// position needs, no joint more than `largest`, plus what the orientation still needs while the tool point
  /// stays, no joint more than `largest_turn` (rad).
  std::array<S, N> solve(const Vector3<S>& position, const Vector3<S>& orientation, S largest,
                         S largest_turn) {
    const Vector3<S> u = multiply(position_.inverse, position);
    const Vector3<S> v = multiply(orientation_.inverse, orientation - multiply(gain_, position));
    const Vector3<S> w = transposed(gain_, v);
    std::array<S, N> shift;
    std::array<S, N> turn;
    for (std::size_t i = 0; i < N; ++i) {
      shift[i] = dot<S>(linear_[i], u);
      turn[i] = dot<S>(angular_[i], v) - dot<S>(linear_[i], w);
    }
    if (hold_below(shift, largest)) gave_up_ = true;
    if (hold_below(turn, largest_turn)) gave_up_ = true;
    for (std::size_t i = 0; i < N; ++i) shift[i] += turn[i];
    return shift;
  }

 private:
  static bool hold_below(std::array<S, N>& v, S largest) {
    const S greatest = greatest_of(v);
    if (!(greatest > largest)) return false;
    const S scale = largest / greatest;
    for (S& x : v) x *= scale;
    return true;
  }
  static void mirror(Matrix3<S>& m) {
    m(1, 0) = m(0, 1);
    m(2, 0) = m(0, 2);
    m(2, 1) = m(1, 2);
  }
  static Vector3<S> multiply(const Matrix3<S>& m, const Vector3<S>& v) {
    return m.col(0) * v.x() + m.col(1) * v.y() + m.col(2) * v.z();
  }
  static Vector3<S> transposed(const Matrix3<S>& m, const Vector3<S>& v) {
    return {dot<S>(m.col(0), v), dot<S>(m.col(1), v), dot<S>(m.col(2), v)};
  }

  std::array<Vector3<S>, N> linear_;
  std::array<Vector3<S>, N> angular_;
  DampedInverse<S> position_;
  DampedInverse<S> orientation_;
  Matrix3<S> gain_;
  bool gave_up_ = false;
};

/// sin(angle) * axis of the rotation that turns `from` into `to`, in the outer frame; exact to third order.
template <class S>
inline Vector3<S> rotation_error(const Matrix3<S>& to, const Matrix3<S>& from) {
  return (cross<S>(from.col(0), to.col(0)) + cross<S>(from.col(1), to.col(1)) +
          cross<S>(from.col(2), to.col(2))) *
         S(0.5);
}

/// Corrections per cycle: two Newton steps and one chord step. Measured over 100,000 poses of the TX60L with
/// the paper's errors and a smallest singular value of at least 0.1: 5e-8 m are left after two, 1e-10 m after
/// three.
constexpr int corrections = 3;

/// What one correction may turn any joint for the orientation, in parts of the largest correction. A regular
/// pose needs far less in the second and third; a stretched arm would use all it gets.
template <class S>
constexpr S allowed_turn(int correction) {
  return correction == 0 ? S(1) : correction == 1 ? S(0.2) : S(0.02);
}

template <class S, std::size_t N>
inline bool is_finite_context(const Context<S, N>& c) {
  bool finite = is_finite(c.payload_kg) && is_finite(c.temperature_c) && is_finite(c.time_s);
  for (std::size_t k = 0; k < 3; ++k)
    finite = finite && is_finite(c.payload_com_m[k]) && is_finite(c.force_n[k]);
  for (std::size_t i = 0; i < N; ++i)
    finite = finite && is_finite(c.direction[i]) && is_finite(c.relative_speed[i]);
  return finite;
}

}  // namespace detail

/// The joint command that brings the arm with all its terms to the pose that the nominal arm has at q_command
/// (rad).
///
/// The result is a pure function of its arguments. Refused (command passed through): a command that is not
/// finite or lies beyond a joint limit, a context that is not finite, and effects that grow beyond all bounds
/// (a joint deflected by more than 1e4 rad, a product that overflows). Otherwise the result is finite, within the joint limits, and no joint
/// differs from its command by more than settings.largest_correction_rad.
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
  Workspace<S, N> ws;
  ws.q = q_command;
  for (std::size_t i = 0; i < N; ++i) ws.reading[i] = sin_cos(q_command[i]);
  detail::nominal_pass(model, ws.reading, ws.frames);
  const Pose<S> target = Pose<S>{ws.frames.rotation[N], ws.frames.origin[N]} * model.nominal_tool();
  detail::Corrector<S, N> corrector;
  corrector.set(ws.frames, target.position, settings);
  const S largest = settings.largest_correction_rad;
  for (int k = 0; k < detail::corrections; ++k) {
    const Pose<S> pose = detail::evaluate(model, context, ws);
    Vector3<S> position = target.position - pose.position;
    Vector3<S> orientation = detail::rotation_error<S>(target.rotation, pose.rotation);
    if (model.has_base()) {
      const Matrix3<S>& b = model.base_pose().rotation;
      position =
          Vector3<S>(dot<S>(b.col(0), position), dot<S>(b.col(1), position), dot<S>(b.col(2), position));
      orientation = Vector3<S>(dot<S>(b.col(0), orientation), dot<S>(b.col(1), orientation),
                               dot<S>(b.col(2), orientation));
    }
    if (k == 1) {
      // The first correction can turn the wrist by 20 mrad near a singularity, which changes the Jacobian by
      // some percent: from here on the chord is the deflected chain's own, close to the solution.
      const Matrix3<S>& flange = ws.frames.rotation[N];
      const Vector3<S>& tool = model.tool_pose().position;
      corrector.set(ws.frames,
                    ws.frames.origin[N] + flange.col(0) * tool.x() + flange.col(1) * tool.y() +
                        flange.col(2) * tool.z(),
                    settings);
    }
    const std::array<S, N> dq =
        corrector.solve(position, orientation, largest, largest * detail::allowed_turn<S>(k));
    for (std::size_t i = 0; i < N; ++i) {
      if (!is_finite(dq[i])) return out;  // effects beyond all bounds end here
      ws.q[i] += dq[i];
      ws.reading[i] = rotate(ws.reading[i], dq[i]);
    }
  }
  std::array<S, N> change;
  for (std::size_t i = 0; i < N; ++i) change[i] = ws.q[i] - q_command[i];
  const S greatest = detail::greatest_of(change);
  out.status = corrector.gave_up() ? StepStatus::near_singular : StepStatus::ok;
  const S scale = greatest > largest ? largest / greatest : S(1);
  if (greatest > largest) out.status = StepStatus::limited;
  for (std::size_t i = 0; i < N; ++i) {
    S q = greatest > largest ? q_command[i] + change[i] * scale : ws.q[i];
    if (q < model.lower(i)) {
      q = model.lower(i);
      out.status = StepStatus::at_limit;
    } else if (q > model.upper(i)) {
      q = model.upper(i);
      out.status = StepStatus::at_limit;
    }
    out.q[i] = q;
  }
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
  const Vector3<S> r = detail::rotation_error<S>(target.rotation, pose.rotation);
  using std::sqrt;
  return {sqrt(dot<S>(p, p)), sqrt(dot<S>(r, r))};
}

}  // namespace flexcomp

#endif
