// SPDX-License-Identifier: Apache-2.0
/// \file
/// Damped least-squares solution of J dq = e, position before orientation (docs/compensation.md, C8 to C10).
///
/// J J^T is factored in 3x3 blocks, position first:
///
///     [P  Q^T] [u]   [e_p]        P = Jp Jp^T + lp^2 1,   Q = Jo Jp^T,
///     [Q  O  ] [v] = [e_o],       M = Jo Jo^T - Q P^-1 Q^T + lo^2 1,   dq = Jp^T u + Jo^T v
///
/// Both dampings (C9) are zero where the arm is regular. Near a singularity lo grows first and smoothly: the
/// first block row still holds exactly, so the error stays in the orientation. lp grows only where the
/// position itself is singular. The solution has two parts: one for the position, and one for the orientation
/// that leaves the tool point in place. Each is scaled as a whole, never joint by joint, and the second is
/// limited more strictly from one correction to the next (C10), because at a stretched arm its corrections
/// would not converge.
#ifndef FLEXCOMP_DETAIL_DAMPED_JACOBIAN_SOLVER_HPP
#define FLEXCOMP_DETAIL_DAMPED_JACOBIAN_SOLVER_HPP

#include <array>
#include <cstddef>

#include "flexcomp/bounds.hpp"
#include "flexcomp/detail/rigid_chain.hpp"
#include "flexcomp/linear.hpp"

namespace flexcomp {

namespace detail {

/// Symmetric 3x3 matrix.
template <class S>
struct Symmetric {
  S xx, yy, zz, xy, xz, yz;

  Symmetric adjugate() const {
    return {yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy,
            xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz};
  }
  Symmetric over(const S& divisor) const {
    const S k = S(1) / divisor;
    return {xx * k, yy * k, zz * k, xy * k, xz * k, yz * k};
  }
};

/// Inverse of a symmetric positive block with damping (C9). `regular` becomes the smaller one of itself and
/// kappa = 1 / trace(A^-1), which is at most the square of the smallest singular value.
template <class S>
inline void damped_inverse(const Symmetric<S>& a, const CompensationSettings<S>& settings,
                           Symmetric<S>& inverse, S& regular) {
  // 1 / trace(A^-1) = det(A) / trace(adj(A)) needs no division by a vanishing determinant.
  const Symmetric<S> b = a.adjugate();
  const S trace = b.xx + b.yy + b.zz;
  const S determinant = a.xx * b.xx + a.xy * b.xy + a.xz * b.xz;
  const S threshold = settings.singular_below * settings.singular_below;
  const S measure = trace > S(0) && determinant > S(0) ? determinant / trace : S(0);
  if (measure < regular) regular = measure;
  if (measure >= threshold) {
    inverse = b.over(determinant);
    return;
  }
  const S lack = S(1) - measure / threshold;
  const S lambda = settings.damping * settings.damping * lack * lack;
  Symmetric<S> d = a;
  d.xx += lambda;
  d.yy += lambda;
  d.zz += lambda;
  const Symmetric<S> e = d.adjugate();
  inverse = e.over(d.xx * e.xx + d.xy * e.xy + d.xz * e.xz);
}

/// Limit of the orientation part in a correction (0, 1, 2), relative to the largest correction (C10). A
/// regular pose needs far less in the second and third; a stretched arm would use all of it.
template <class S>
constexpr S allowed_turn(int correction) {
  return correction == 0 ? S(1) : correction == 1 ? S(0.2) : S(0.02);
}

/// Most corrections of a command: one from the nominal pose and two from the chain itself.
constexpr int most_corrections = 3;
/// Block factorisation of the Jacobian of one pose, and its damped solutions (C8).
///
/// Structures are read and written scalar by scalar: copied as a whole they would go through memory.
template <class S, std::size_t N>
class DampedJacobianSolver {
 public:
  /// Axes and origins of the joints of the pose, in F0 (m): filled in before set(), which overwrites them.
  std::array<JointAxis<S>, N>& joints() { return column_; }

  /// Factors the Jacobian at the tool point, in F0, m. Work: one pass over the joints, two 3x3 inverses.
  void set(const Vec3<S>& tool, const CompensationSettings<S>& settings) {
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
    if (!(regular_ >= settings.singular_below * settings.singular_below)) damped_ = true;
  }

  /// Motion of tool point (m) and flange (rad) by joint turns, to first order: J dq.
  void motion_by(const std::array<S, N>& dq, SmallMotion<S>& out) const {
    out.linear = out.angular = {S(0), S(0), S(0)};
    for (std::size_t i = 0; i < N; ++i) {
      out.linear = out.linear + column_[i].origin * dq[i];
      out.angular = out.angular + column_[i].axis * dq[i];
    }
  }

  /// True where any solution so far was damped (C9) or scaled (C10).
  bool is_damped() const { return damped_; }
  /// kappa of (C9), the smaller one of both blocks, at most 1: m^2, or 1 for orientation.
  S regular() const { return regular_; }
  /// True where turns of the joints since set() with this sum of squares (rad^2) change the Jacobian by a
  /// tenth or more.
  bool jacobian_is_stale(S square) const { return !(square <= S(0.01) * regular_); }

  /// Solution (C8) for errors of position (m) and orientation (rad) in F0: joint turns dq, rad. The position
  /// part is limited to `largest`, the orientation part to `largest_turn` (C10). Returns the sum of squares
  /// of dq.
  S solve(const Vec3<S>& position, const Vec3<S>& orientation, S largest, S largest_turn,
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
    // |position part|^2 <= u . position and |orientation part|^2 <= v . e: in most cases nothing has to be
    // scaled.
    if (!(ux * px + uy * py + uz * pz <= largest * largest &&
          vx * ex + vy * ey + vz * ez <= largest_turn * largest_turn)) {
      return solve_limited({ux, uy, uz}, {vx, vy, vz}, {wx, wy, wz}, largest, largest_turn, dq);
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
  FLEXCOMP_ONCE S solve_limited(const Vec3<S>& u, const Vec3<S>& v, const Vec3<S>& w, S largest,
                                S largest_turn, std::array<S, N>& dq) {
    std::array<S, N> turn;
    for (std::size_t i = 0; i < N; ++i) {
      dq[i] = dot(column_[i].origin, u);
      turn[i] = dot(column_[i].axis, v) - dot(column_[i].origin, w);
    }
    if (scale_to_limit(dq, largest)) damped_ = true;
    if (scale_to_limit(turn, largest_turn)) damped_ = true;
    for (std::size_t i = 0; i < N; ++i) dq[i] += turn[i];
    return square_of(dq);
  }

  std::array<JointAxis<S>, N> column_;  ///< axis, and in the place of the origin: axis x (tool - origin)
  Symmetric<S> position_;
  Symmetric<S> orientation_;
  S gain_[9];  ///< rows of Q P^-1
  S regular_ = S(0);
  bool damped_ = false;
};

}  // namespace detail
}  // namespace flexcomp

#endif
