/// \file
/// Inverse compensation: the joint command that brings the flexible arm to the nominal pose of the command.
///
/// Bounded work whatever the input. Where the effects of a set only turn joints (Model::only_joints_yield(), which all
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
/// J J^T is factored in 3x3 blocks, position first:
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
/// is continuous but for what one step more or less changes: 1e-9 rad where the arm is regular, and nowhere more
/// than core_compensation_test's bound on its slope through the singularities.
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
  std::array<S, N> q;  ///< corrected joint command, rad
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
inline void damped_inverse(const Symmetric<S>& a, const CompensationSettings<S>& settings,
                           Symmetric<S>& inverse, S& regular) {
  // 1 / trace(A^-1) = det(A) / trace(adj(A)) needs no division by a vanishing determinant.
  const S xx = a.yy * a.zz - a.yz * a.yz;
  const S yy = a.xx * a.zz - a.xz * a.xz;
  const S zz = a.xx * a.yy - a.xy * a.xy;
  const S xy = a.xz * a.yz - a.xy * a.zz;
  const S xz = a.xy * a.yz - a.xz * a.yy;
  const S yz = a.xy * a.xz - a.xx * a.yz;
  const S trace = xx + yy + zz;
  const S determinant = a.xx * xx + a.xy * xy + a.xz * xz;
  const S threshold = settings.singular_below * settings.singular_below;
  const S measure = trace > S(0) && determinant > S(0) ? determinant / trace : S(0);
  if (measure < regular) regular = measure;
  if (measure >= threshold) {
    const S k = S(1) / determinant;
    inverse.xx = xx * k;
    inverse.yy = yy * k;
    inverse.zz = zz * k;
    inverse.xy = xy * k;
    inverse.xz = xz * k;
    inverse.yz = yz * k;
    return;
  }
  const S lack = S(1) - measure / threshold;
  const S lambda = settings.damping * settings.damping * lack * lack;
  Symmetric<S> d = a;
  d.xx += lambda;
  d.yy += lambda;
  d.zz += lambda;
  const Symmetric<S> b = d.adjugate();
  const S k = S(1) / (d.xx * b.xx + d.xy * b.xy + d.xz * b.xz);
  inverse = {b.xx * k, b.yy * k, b.zz * k, b.xy * k, b.xz * k, b.yz * k};
}

/// Largest magnitude in a list; NaNs are skipped.
template <class S, std::size_t N>
FLEXCOMP_ONCE S greatest_of(const std::array<S, N>& v) {
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
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) sum += v[i] * v[i];
  return sum;
}

/// The factored Jacobian of one pose; every correction of a cycle uses it.
///
/// Here and below structures are read and written scalar by scalar: copied as a whole they would go through memory.
template <class S, std::size_t N>
class Corrector {
 public:
  /// Axes and origins of the joints of the pose, in F0: to be filled in before set(), which uses them up.
  std::array<JointAxis<S>, N>& joints() { return column_; }

  /// Factors the Jacobian at the point `tool`, in F0.
  void set(const Triple<S>& tool, const CompensationSettings<S>& settings) {
    regular_ = S(1);
    Symmetric<S> block;
    {
      const S tx = tool.x, ty = tool.y, tz = tool.z;
      S xx = S(0), yy = S(0), zz = S(0), xy = S(0), xz = S(0), yz = S(0);
      for (JointAxis<S>& c : column_) {
        const S rx = tx - c.origin.x, ry = ty - c.origin.y, rz = tz - c.origin.z;
        const S lx = c.axis.y * rz - c.axis.z * ry;
        const S ly = c.axis.z * rx - c.axis.x * rz;
        const S lz = c.axis.x * ry - c.axis.y * rx;
        c.origin.x = lx;
        c.origin.y = ly;
        c.origin.z = lz;
        xx += lx * lx;
        yy += ly * ly;
        zz += lz * lz;
        xy += lx * ly;
        xz += lx * lz;
        yz += ly * lz;
      }
      block = {xx, yy, zz, xy, xz, yz};
    }
    damped_inverse(block, settings, position_, regular_);
    // Rows of Q = Jo Jp^T.
    S q[9];
    {
      S a = S(0), b = S(0), c = S(0), d = S(0), e = S(0), f = S(0), g = S(0), h = S(0), k = S(0);
      for (const JointAxis<S>& j : column_) {
        const S lx = j.origin.x, ly = j.origin.y, lz = j.origin.z;
        const S zx = j.axis.x, zy = j.axis.y, zz = j.axis.z;
        a += zx * lx;
        b += zx * ly;
        c += zx * lz;
        d += zy * lx;
        e += zy * ly;
        f += zy * lz;
        g += zz * lx;
        h += zz * ly;
        k += zz * lz;
      }
      q[0] = a, q[1] = b, q[2] = c, q[3] = d, q[4] = e, q[5] = f, q[6] = g, q[7] = h, q[8] = k;
    }
    // Jo Jo^T - Q P^-1 Q^T
    S xx = S(0), yy = S(0), zz = S(0), xy = S(0), xz = S(0), yz = S(0);
    for (const JointAxis<S>& j : column_) {
      const S x = j.axis.x, y = j.axis.y, z = j.axis.z;
      xx += x * x;
      yy += y * y;
      zz += z * z;
      xy += x * y;
      xz += x * z;
      yz += y * z;
    }
    for (int r = 0; r < 3; ++r) {
      const S x = q[3 * r], y = q[3 * r + 1], z = q[3 * r + 2];
      gain_[3 * r] = position_.xx * x + position_.xy * y + position_.xz * z;
      gain_[3 * r + 1] = position_.xy * x + position_.yy * y + position_.yz * z;
      gain_[3 * r + 2] = position_.xz * x + position_.yz * y + position_.zz * z;
    }
    xx -= gain_[0] * q[0];
    xx -= gain_[1] * q[1];
    xx -= gain_[2] * q[2];
    xy -= gain_[0] * q[3];
    xy -= gain_[1] * q[4];
    xy -= gain_[2] * q[5];
    xz -= gain_[0] * q[6];
    xz -= gain_[1] * q[7];
    xz -= gain_[2] * q[8];
    yy -= gain_[3] * q[3];
    yy -= gain_[4] * q[4];
    yy -= gain_[5] * q[5];
    yz -= gain_[3] * q[6];
    yz -= gain_[4] * q[7];
    yz -= gain_[5] * q[8];
    zz -= gain_[6] * q[6];
    zz -= gain_[7] * q[7];
    zz -= gain_[8] * q[8];
    block = {xx, yy, zz, xy, xz, yz};
    damped_inverse(block, settings, orientation_, regular_);
    if (!(regular_ >= settings.singular_below * settings.singular_below)) gave_up_ = true;
  }

  /// Whether any correction so far was damped or scaled down.
  bool gave_up() const { return gave_up_; }
  /// Never above the square of the smallest singular value of either block (m^2, or 1 for orientation).
  S regular() const { return regular_; }
  /// True where joints that turned by this sum of squares (rad^2) since set() have made the factored Jacobian a tenth
  /// wrong or more.
  bool is_worn_by(S square) const { return !(square <= S(0.01) * regular_); }

  /// Joint correction for a position error (m) and a small orientation error (rad), both in F0: what the
  /// position needs, no joint more than `largest`, plus what the orientation still needs while the tool point
  /// stays, no joint more than `largest_turn` (rad). Returns the sum of its squares.
  S solve(const Triple<S>& position, const Triple<S>& orientation, S largest, S largest_turn,
          std::array<S, N>& dq) {
    const S px = position.x, py = position.y, pz = position.z;
    S ux = position_.xx * px + position_.xy * py + position_.xz * pz;
    S uy = position_.xy * px + position_.yy * py + position_.yz * pz;
    S uz = position_.xz * px + position_.yz * py + position_.zz * pz;
    const S ex = orientation.x - (gain_[0] * px + gain_[1] * py + gain_[2] * pz);
    const S ey = orientation.y - (gain_[3] * px + gain_[4] * py + gain_[5] * pz);
    const S ez = orientation.z - (gain_[6] * px + gain_[7] * py + gain_[8] * pz);
    const S vx = orientation_.xx * ex + orientation_.xy * ey + orientation_.xz * ez;
    const S vy = orientation_.xy * ex + orientation_.yy * ey + orientation_.yz * ez;
    const S vz = orientation_.xz * ex + orientation_.yz * ey + orientation_.zz * ez;
    const S wx = gain_[0] * vx + gain_[3] * vy + gain_[6] * vz;
    const S wy = gain_[1] * vx + gain_[4] * vy + gain_[7] * vz;
    const S wz = gain_[2] * vx + gain_[5] * vy + gain_[8] * vz;
    // |shift|^2 <= u . position and |turn|^2 <= v . rest: nearly always nothing has to be scaled down.
    if (!(ux * px + uy * py + uz * pz <= largest * largest &&
          vx * ex + vy * ey + vz * ez <= largest_turn * largest_turn)) {
      return solve_held({ux, uy, uz}, {vx, vy, vz}, {wx, wy, wz}, largest, largest_turn, dq);
    }
    ux -= wx;
    uy -= wy;
    uz -= wz;
    S square = S(0);
    FLEXCOMP_UNROLL
    for (std::size_t i = 0; i < N; ++i) {
      const JointAxis<S>& c = column_[i];
      S turn = c.axis.x * vx;
      turn += c.axis.y * vy;
      turn += c.axis.z * vz;
      turn += c.origin.x * ux;
      turn += c.origin.y * uy;
      turn += c.origin.z * uz;
      dq[i] = turn;
      square += turn * turn;
    }
    return square;
  }

 private:
  FLEXCOMP_ONCE S solve_held(const Triple<S>& u, const Triple<S>& v, const Triple<S>& w, S largest,
                             S largest_turn, std::array<S, N>& dq) {
    std::array<S, N> turn;
    for (std::size_t i = 0; i < N; ++i) {
      dq[i] = dot(column_[i].origin, u);
      turn[i] = dot(column_[i].axis, v) - dot(column_[i].origin, w);
    }
    if (hold_below(dq, largest)) gave_up_ = true;
    if (hold_below(turn, largest_turn)) gave_up_ = true;
    for (std::size_t i = 0; i < N; ++i) dq[i] += turn[i];
    return square_of(dq);
  }
  FLEXCOMP_ONCE static bool hold_below(std::array<S, N>& v, S largest) {
    const S greatest = greatest_of(v);
    if (!(greatest > largest)) return false;
    const S scale = largest / greatest;
    for (S& x : v) x *= scale;
    return true;
  }

  std::array<JointAxis<S>, N> column_;  ///< axis, and in the place of the origin axis x (tool - origin)
  Symmetric<S> position_;
  Symmetric<S> orientation_;
  S gain_[9];  ///< rows of Q P^-1
  S regular_ = S(0);
  bool gave_up_ = false;
};

/// sin(angle) * axis of the rotation that turns `from` into `to` (columns), in the outer frame; exact to third
/// order.
template <class S>
inline void rotation_error(const ThreeTriples<S>& to, const ThreeTriples<S>& from, Triple<S>& error) {
  S x = from.a.y * to.a.z - from.a.z * to.a.y;
  S y = from.a.z * to.a.x - from.a.x * to.a.z;
  S z = from.a.x * to.a.y - from.a.y * to.a.x;
  x += from.b.y * to.b.z;
  x -= from.b.z * to.b.y;
  y += from.b.z * to.b.x;
  y -= from.b.x * to.b.z;
  z += from.b.x * to.b.y;
  z -= from.b.y * to.b.x;
  x += from.c.y * to.c.z;
  x -= from.c.z * to.c.y;
  y += from.c.z * to.c.x;
  y -= from.c.x * to.c.z;
  z += from.c.x * to.c.y;
  z -= from.c.y * to.c.x;
  error.x = S(0.5) * x;
  error.y = S(0.5) * y;
  error.z = S(0.5) * z;
}

/// A point of the flange frame, in F0.
template <class S>
inline void flange_point(const FlangePose<S>& flange, const Vector3<S>& at, Triple<S>& point) {
  const S x = at[0], y = at[1], z = at[2];
  const ThreeTriples<S>& f = flange.axes;
  point.x = flange.origin.x + (f.a.x * x + f.b.x * y + f.c.x * z);
  point.y = flange.origin.y + (f.a.y * x + f.b.y * y + f.c.y * z);
  point.z = flange.origin.z + (f.a.z * x + f.b.z * y + f.c.z * z);
}

/// How the tool point (m) and the rotation (rad) move when the joints of this chain turn by dq, to second order.
template <class S, std::size_t N>
inline void motion(const std::array<JointAxis<S>, N>& joint, const Triple<S>& tool,
                   const std::array<S, N>& dq, Twist<S>& out) {
  // From the flange inward: what the outer joints do is turned by the inner ones.
  S px = tool.x, py = tool.y, pz = tool.z;
  S wx = S(0), wy = S(0), wz = S(0);
  for (std::size_t i = N; i-- > 0;) {
    const JointAxis<S>& j = joint[i];
    const S k = dq[i];
    const S ax = j.axis.x * k, ay = j.axis.y * k, az = j.axis.z * k;
    const S rx = px - j.origin.x, ry = py - j.origin.y, rz = pz - j.origin.z;
    // p + a x r + a x (a x r) / 2
    const S cx = ay * rz - az * ry, cy = az * rx - ax * rz, cz = ax * ry - ay * rx;
    const S hx = S(0.5) * ax, hy = S(0.5) * ay, hz = S(0.5) * az;
    px += cx;
    px += hy * cz;
    px -= hz * cy;
    py += cy;
    py += hz * cx;
    py -= hx * cz;
    pz += cz;
    pz += hx * cy;
    pz -= hy * cx;
    // w + a + a x w / 2
    const S ux = wx, uy = wy, uz = wz;
    wx += ax;
    wx += hy * uz;
    wx -= hz * uy;
    wy += ay;
    wy += hz * ux;
    wy -= hx * uz;
    wz += az;
    wz += hx * uy;
    wz -= hy * ux;
  }
  const S vx = px - tool.x, vy = py - tool.y, vz = pz - tool.z;
  out.linear = {vx, vy, vz};
  out.angular = {wx, wy, wz};
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
  const S none = S(0);
  S zero = none * c.payload_kg;
  zero += none * c.temperature_c;
  zero += none * c.time_s;
  FLEXCOMP_UNROLL
  for (std::size_t k = 0; k < 3; ++k) {
    zero += none * c.payload_com_m[k];
    zero += none * c.force_n[k];
  }
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) {
    zero += none * c.direction[i];
    zero += none * c.relative_speed[i];
  }
  return zero <= S(0);
}

/// Where the flange and the tool point of the chain with constant terms are to be, in F0: the nominal pose
/// without B and without the tool's constant terms.
template <class S>
struct Aim {
  FlangePose<S> flange;
  Triple<S> tool_point;
};

/// Turns the nominal pose, with which `aim` comes, into that.
template <class S, std::size_t N, class Cap>
inline void take_aim(const Model<S, N, Cap>& model, Aim<S>& aim) {
  ThreeTriples<S>& axes = aim.flange.axes;
  if (model.turns_tool()) {
    const ThreeTriples<S> nominal = axes;
    int k = 0;
    for (Triple<S>* v : {&axes.a, &axes.b, &axes.c}) {
      const Triple<S> turn = triple<S>(model.tool_turn().col(k++));
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
  for (Triple<S>* v : {&axes.a, &axes.b, &axes.c, &aim.tool_point}) {
    const S x = v->x, y = v->y, z = v->z;
    v->x = xx * x + xy * y + xz * z;
    v->y = yx * x + yy * y + yz * z;
    v->z = zx * x + zy * y + zz * z;
  }
}

template <class S, std::size_t N>
inline void sin_cos_all(const std::array<S, N>& q, const std::array<LinkShape<S>, N>& links,
                        std::array<SinCos<S>, N>& angle) {
  for (std::size_t i = 0; i < N; ++i) {
    S s, c;
    sin_cos_kernel(q[i], s, c);
    const S os = links[i].offset.s, oc = links[i].offset.c;
    angle[i].s = s * oc + c * os;
    angle[i].c = c * oc - s * os;
  }
}

template <class S, std::size_t N>
FLEXCOMP_ONCE void rotate_all_far(std::array<SinCos<S>, N>& angle, const std::array<S, N>& by) {
  for (std::size_t i = 0; i < N; ++i) angle[i] = rotate(angle[i], by[i]);
}

/// Turns all angles; `square` is the sum of the squares. Without the last terms of rotate(): up to 1/64 rad they leave
/// 1e-11.
template <class S, std::size_t N>
FLEXCOMP_ONCE void rotate_all(std::array<SinCos<S>, N>& angle, const std::array<S, N>& by, S square) {
  if (!(square < S(0.000244140625))) {
    rotate_all_far(angle, by);
    return;
  }
  for (std::size_t i = 0; i < N; ++i) {
    const S d = by[i];
    const S z = d * d;
    const S sine = d - d * (z * S(1.0 / 6));
    const S versine = z * (S(0.5) - z * S(1.0 / 24));
    S s = angle[i].s, c = angle[i].c;
    const S t = s;
    s += c * sine;
    s -= t * versine;
    angle[i].s = s;
    const S u = c;
    c -= t * sine;
    c -= u * versine;
    angle[i].c = c;
  }
}

/// What turns joints without frames and not by their own reading alone.
template <class S, std::size_t N, class Cap>
inline void add_other_yield(const Model<S, N, Cap>& model, const std::array<S, N>& q,
                            const Context<S, N>& context, std::array<S, N>& yield) {
  for (std::size_t k = 0; k < model.other_count(); ++k) {
    const Term<S>& term = model.other_term(k);
    yield[term.place.body - 1U] += term.coefficient * plain_basis_value(model, term, context, q);
  }
}

/// Takes the terms of Model::own_term() off the readings q: x + own(x) = q by Newton's method, with the curvature.
template <class S, std::size_t N, class Cap>
inline void take_own_yield(const Model<S, N, Cap>& model, const Context<S, N>& context, std::array<S, N>& q,
                           std::array<S, N>& dq, std::array<S, N>& share) {
  std::array<Local<S>, N> own;
  for (Local<S>& o : own) o.value = o.slope = o.half_curvature = S(0);
  for (std::size_t k = 0; k < model.own_count(); ++k) {
    const Term<S>& term = model.own_term(k);
    add_own_yield(model, term, q[term.joint], context, own[term.joint]);
  }
  for (std::size_t i = 0; i < N; ++i) {
    const S w = S(1) / (S(1) + own[i].slope);
    const S newton = own[i].value * w;
    const S step = newton + own[i].half_curvature * newton * newton * w;
    share[i] = w;
    q[i] -= step;
    dq[i] -= step;
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
struct Enough {
  static constexpr S correction = S(1e-8);   ///< of the chain: the next one is a third-order rest of it
  static constexpr S rough = S(0);           ///< what a first solution of the linear problem leaves
  static constexpr S refinement = S(2e-20);  ///< what the next refinement would be
  static constexpr S bend = S(0);            ///< what the yield beside the chain leaves out
  static constexpr S yield_step = S(6e-20);  ///< what the next evaluation of the yield would change
};
template <>
struct Enough<float> {
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
inline void correct_yielding_joints(const Model<S, N, Cap>& model, Aim<S>& aim, const Context<S, N>& context,
                                    std::array<SinCos<S>, N>& angle, Corrector<S, N>& corrector,
                                    const CompensationSettings<S>& settings, std::array<S, N>& q) {
  const S largest = settings.largest_correction_rad;
  std::array<S, N> dq;
  Twist<S> move;
  // First what the constant terms do to the nominal chain, to first order.
  constant_twist(model, angle, move);
  {
    const Twist<S>& base = model.base_twist();
    const Triple<S> turn = {-move.angular.x - base.angular.x, -move.angular.y - base.angular.y,
                            -move.angular.z - base.angular.z};
    const S tx = aim.tool_point.x, ty = aim.tool_point.y, tz = aim.tool_point.z;
    const Triple<S> shift = {turn.y * tz - turn.z * ty - move.linear.x - base.linear.x,
                             turn.z * tx - turn.x * tz - move.linear.y - base.linear.y,
                             turn.x * ty - turn.y * tx - move.linear.z - base.linear.z};
    corrector.solve(shift, turn, largest, largest, dq);
  }
  take_aim(model, aim);
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

  const bool loaded = model.yields_to_loads() || model.lever_count() != 0;
  const bool direct = model.own_count() + model.other_count() != 0;
  CarriedLoad<S> load;
  std::array<S, N> yield;
  if (loaded) carried_load(model, context, load);
  std::array<JointAxis<S>, N> joints;
  FlangePose<S> flange;
  YieldAround<S, N> around;
  bool fresh = false;
  int k = 1;
  for (;; ++k) {
    rigid_pass(model.shapes(), angle, joints, flange);
    Triple<S> point;
    flange_point(flange, model.tool_pose().position, point);
    if (k == 1 && loaded) {
      if (load.is_plain) {
        around.set(model, q, joints, flange, load, yield);
      } else {
        // At the joint's angle instead of its reading: off by itself times its slope.
        loaded_yield(model, q, angle, load, yield);
      }
    }
    const Triple<S> shift = {aim.tool_point.x - point.x, aim.tool_point.y - point.y,
                             aim.tool_point.z - point.z};
    Triple<S> turn;
    rotation_error(aim.flange.axes, flange.axes, turn);
    const S largest_turn = largest * allowed_turn<S>(k);
    // Beside a singularity the first correction can turn the wrist by 20 mrad, which changes the Jacobian by some
    // percent: from there on it is the one close to the solution.
    if (k == 1 && (corrector.gave_up() || corrector.is_worn_by(turned))) {
      corrector.joints() = joints;
      corrector.set(point, settings);
      fresh = true;
    }
    S square = corrector.solve(shift, turn, largest, largest_turn, dq);
    // The factored Jacobian is off by about the turn over the smallest singular value, and the correction with it.
    bool done = fresh || turned * square <= Enough<S>::rough * corrector.regular();
    for (int n = 0; n < most_refinements && !done; ++n) {
      // The factored Jacobian is the nominal arm's, off by some 1e-2: what it leaves is solved for again, the second
      // order of the motion with it.
      motion(joints, point, dq, move);
      const Triple<S> shift_left = {shift.x - move.linear.x, shift.y - move.linear.y,
                                    shift.z - move.linear.z};
      const Triple<S> turn_left = {turn.x - move.angular.x, turn.y - move.angular.y, turn.z - move.angular.z};
      std::array<S, N> rest;
      const S left = corrector.solve(shift_left, turn_left, largest, largest_turn, rest);
      // Each of them leaves the same part of the one before.
      done = left * left <= Enough<S>::refinement * square;
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
    if (done && !corrector.gave_up() && square <= (fresh ? S(0.02) : S(1)) * Enough<S>::correction) break;
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
    if (square_of(yield) * square * square <= Enough<S>::bend) return;
  }
  for (int n = 0; n < most_yield_steps; ++n) {
    std::array<S, N> now;
    if (loaded) {
      rotate_all(angle, dq, square);
      loaded_yield(model, q, angle, load, now);
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
    if (square * size <= Enough<S>::yield_step) break;
  }
}

/// For all other sets: the forward model with its two passes, three times; Newton, Newton, chord.
template <class S, std::size_t N, class Cap>
inline void correct_any(const Model<S, N, Cap>& model, const Pose<S>& target, const Context<S, N>& context,
                        const CompensationSettings<S>& settings, Corrector<S, N>& corrector,
                        std::array<S, N>& q) {
  Workspace<S, N> ws;
  ws.q = q;
  for (std::size_t i = 0; i < N; ++i) ws.reading[i] = sin_cos(q[i]);
  const S largest = settings.largest_correction_rad;
  for (int k = 0; k < most_corrections; ++k) {
    const Pose<S> pose = evaluate(model, context, ws);
    Triple<S> position = triple<S>(target.position) - triple<S>(pose.position);
    Triple<S> orientation;
    rotation_error(columns_of(target.rotation), columns_of(pose.rotation), orientation);
    if (model.has_base()) {
      const ThreeTriples<S> b = columns_of(model.base_pose().rotation);
      position = {dot(b.a, position), dot(b.b, position), dot(b.c, position)};
      orientation = {dot(b.a, orientation), dot(b.b, orientation), dot(b.c, orientation)};
    }
    if (k == 1) {
      // The first correction can turn the wrist by 20 mrad near a singularity, which changes the Jacobian by
      // some percent: from here on the chord is the deflected chain's own, close to the solution.
      for (std::size_t i = 0; i < N; ++i)
        corrector.joints()[i] = {triple<S>(ws.frames.axis(i, 2)), triple<S>(ws.frames.origin[i])};
      const Triple<S> tool = triple<S>(model.tool_pose().position);
      corrector.set(triple<S>(ws.frames.origin[N]) + combine(columns_of(ws.frames.rotation[N]), tool),
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
  detail::Corrector<S, N> corrector;
  detail::Aim<S> aim;
  detail::rigid_pass(model.nominals(), angle, corrector.joints(), aim.flange);
  detail::flange_point(aim.flange, model.nominal_tool().position, aim.tool_point);
  corrector.set(aim.tool_point, settings);
  std::array<S, N> q;
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) q[i] = q_command[i];
  if (model.only_joints_yield()) {
    detail::correct_yielding_joints(model, aim, context, angle, corrector, settings, q);
  } else {
    const Pose<S> target = nominal_forward(model, q_command);
    detail::correct_any(model, target, context, settings, corrector, q);
  }
  // Effects beyond all bounds end here, as a NaN, an infinity or a turn that no arm makes.
  S square = S(0);
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) {
    const S change = q[i] - q_command[i];
    square += change * change;
  }
  if (!(square < S(1e8))) return refuse();
  out.status = corrector.gave_up() ? StepStatus::near_singular : StepStatus::ok;
  if (square > largest * largest) {
    std::array<S, N> change;
    for (std::size_t i = 0; i < N; ++i) change[i] = q[i] - q_command[i];
    const S greatest = detail::greatest_of(change);
    if (greatest > largest) {
      out.status = StepStatus::limited;
      const S scale = largest / greatest;
      for (std::size_t i = 0; i < N; ++i) q[i] = q_command[i] + change[i] * scale;
    }
  }
  for (std::size_t i = 0; i < N; ++i) {
    S x = q[i];
    if (x < model.lower(i)) {
      x = model.lower(i);
      out.status = StepStatus::at_limit;
    } else if (x > model.upper(i)) {
      x = model.upper(i);
      out.status = StepStatus::at_limit;
    }
    out.q[i] = x;
  }
}

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
  Triple<S> r;
  detail::rotation_error(columns_of(target.rotation), columns_of(pose.rotation), r);
  using std::sqrt;
  return {sqrt(dot<S>(p, p)), sqrt(dot(r, r))};
}

}  // namespace flexcomp

#endif
