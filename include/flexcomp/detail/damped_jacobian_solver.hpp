// SPDX-License-Identifier: Apache-2.0
/// \file
/// Damped least-squares solution of J dq = e, position before orientation (docs/compensation.md, C8 to C10).
///
/// J J^T is factored in 3x3 blocks, position first:
///
///     [P  Q^T] [u]   [e_p]        P = Jp Jp^T + lp 1,     Q = Jo Jp^T,
///     [Q  O  ] [v] = [e_o],       M = Jo Jo^T - Q P^-1 Q^T + lo W,     dq = Jp^T u + Jo^T v
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
#include "flexcomp/singular_region.hpp"

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
  Vec3<S> operator*(const Vec3<S>& v) const {
    return {xx * v.x + xy * v.y + xz * v.z, xy * v.x + yy * v.y + yz * v.z, xz * v.x + yz * v.y + zz * v.z};
  }
  Symmetric over(const S& divisor) const {
    const S k = S(1) / divisor;
    return {xx * k, yy * k, zz * k, xy * k, xz * k, yz * k};
  }
};

/// Adds v v^T.
template <class S>
inline void add_outer(const Vec3<S>& v, Symmetric<S>& a) {
  a.xx += v.x * v.x, a.yy += v.y * v.y, a.zz += v.z * v.z;
  a.xy += v.x * v.y, a.xz += v.x * v.z, a.yz += v.y * v.z;
}

/// Determinant of a symmetric matrix with this adjugate.
template <class S>
inline S determinant(const Symmetric<S>& a, const Symmetric<S>& adjugate) {
  return a.xx * adjugate.xx + a.xy * adjugate.xy + a.xz * adjugate.xz;
}

/// Trace of the product of two symmetric matrices.
template <class S>
inline S trace_of_product(const Symmetric<S>& a, const Symmetric<S>& b) {
  return a.xx * b.xx + a.yy * b.yy + a.zz * b.zz + S(2) * (a.xy * b.xy + a.xz * b.xz + a.yz * b.yz);
}

/// Inverse of a symmetric positive matrix by its L D L^T factors, and its determinant: errors grow with the condition
/// number, those of the adjugate with its square.
template <class S>
FLEXCOMP_RARE S invert_factored(const Symmetric<S>& a, Symmetric<S>& inverse) {
  const S x = S(1) / a.xx;
  const S l = a.xy * x, m = a.xz * x;
  const S d = a.yy - l * a.xy;
  const S e = a.yz - l * a.xz;
  const S y = S(1) / d;
  const S n = e * y;
  const S f = a.zz - m * a.xz - n * e;
  const S z = S(1) / f;
  const S k = l * n - m;  // of L^-1, last row: k, -n, 1
  inverse.zz = z;
  inverse.yz = -n * z;
  inverse.xz = k * z;
  inverse.yy = y + n * n * z;
  inverse.xy = -l * y - n * k * z;
  inverse.xx = x + l * l * y + k * k * z;
  return a.xx * d * f;
}

/// A + k W.
template <class S>
inline Symmetric<S> sum(const Symmetric<S>& a, const S& k, const Symmetric<S>& w) {
  return {a.xx + k * w.xx, a.yy + k * w.yy, a.zz + k * w.zz,
          a.xy + k * w.xy, a.xz + k * w.xz, a.yz + k * w.yz};
}

/// Inverse of a symmetric positive block A, damped along W (C9) where the least eigenvalue of A against W is below
/// `threshold`. Returns the lack of (C9), 0 where it is not, up to 1.
template <class S>
FLEXCOMP_RARE S damped_inverse(const Symmetric<S>& a, const Symmetric<S>& w, S threshold,
                               Symmetric<S>& inverse) {
  // The eigenvalues z of (A + t W)^-1 t W are t / (mu + t), with z^3 - e1 z^2 + e2 z - e3 = 0. All are real and at most 1:
  // from there Newton's method falls to the greatest one. The number of steps is fixed: a smooth function of A and W.
  const S t = threshold;
  const Symmetric<S> d = sum(a, t, w);
  const S scale = t / invert_factored(d, inverse);
  const Symmetric<S> v = w.adjugate();
  const S e1 = t * trace_of_product(inverse, w);
  const S e2 = t * scale * trace_of_product(d, v);
  const S e3 = t * t * scale * determinant(w, v);
  S z = S(1);
  for (int n = 0; n < 6; ++n) {
    const S value = ((z - e1) * z + e2) * z - e3;
    const S rise = (S(3) * z - S(2) * e1) * z + e2;
    if (!(value > S(0) && rise > S(0))) break;
    z -= value / rise;
  }
  // mu / t = 1 / z - 1
  const S lack = S(2) - S(1) / z;
  if (!(lack > S(0))) {
    invert_factored(a, inverse);
    return S(0);
  }
  invert_factored(sum(a, t * lack * lack, w), inverse);
  return lack;
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

  /// Factors the Jacobian at the tool point, in F0, m. False where an eigenvalue may be below its threshold: set_damped()
  /// has to follow. Work: one pass over the joints, two 3x3 inverses.
  FLEXCOMP_ONCE bool set(const Vec3<S>& tool, const SingularRegion<S>& region) {
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
    const S of_position = invert(block, position_);
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
    const S of_orientation = invert(block, orientation_);
    regular_ = of_position < of_orientation ? of_position : of_orientation;
    if (!(regular_ < S(1))) regular_ = S(1);
    // W is at most 1 + l^2 tr(G G^T), and the trace at most that of Q P^-1 Q^T over the least eigenvalue of P: N / kappa of P.
    return of_position >= region.position &&
           of_orientation * of_position >=
               region.orientation * (of_position + S(static_cast<int>(N)) * region.length_squared);
  }

  /// The factorisation of set() again, with damping (C9) where an eigenvalue is below its threshold.
  FLEXCOMP_RARE void set_damped(const SingularRegion<S>& region) {
    Symmetric<S> p{}, m{};
    Vec3<S> q[3] = {};
    for (const JointAxis<S>& c : column_) {
      add_outer(c.origin, p);
      add_outer(c.axis, m);
      q[0] = q[0] + c.origin * c.axis.x;
      q[1] = q[1] + c.origin * c.axis.y;
      q[2] = q[2] + c.origin * c.axis.z;
    }
    Symmetric<S> w = {S(1), S(1), S(1), S(0), S(0), S(0)};
    take_lack(damped_inverse(p, w, region.position, position_));
    Vec3<S> g[3];
    for (int r = 0; r < 3; ++r) {
      g[r] = position_ * q[r];
      gain_[3 * r] = g[r].x, gain_[3 * r + 1] = g[r].y, gain_[3 * r + 2] = g[r].z;
    }
    const S l = region.length_squared;
    m.xx -= dot(g[0], q[0]), m.yy -= dot(g[1], q[1]), m.zz -= dot(g[2], q[2]);
    m.xy -= dot(g[0], q[1]), m.xz -= dot(g[0], q[2]), m.yz -= dot(g[1], q[2]);
    w.xx += l * dot(g[0], g[0]), w.yy += l * dot(g[1], g[1]), w.zz += l * dot(g[2], g[2]);
    w.xy += l * dot(g[0], g[1]), w.xz += l * dot(g[0], g[2]), w.yz += l * dot(g[1], g[2]);
    take_lack(damped_inverse(m, w, region.orientation, orientation_));
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
  /// 1 where no factorisation so far was damped, 0 at a singularity, smooth between.
  S undamped_share() const { return (S(1) - lack_) * (S(1) - lack_); }
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
  /// Inverse of a block A, of no use where A is singular. Returns kappa = 1 / trace(A^-1) of (C9).
  static S invert(const Symmetric<S>& a, Symmetric<S>& inverse) {
    // 1 / trace(A^-1) = det(A) / trace(adj(A)) needs no division by a vanishing determinant.
    const Symmetric<S> b = a.adjugate();
    const S trace = b.xx + b.yy + b.zz;
    const S det = determinant(a, b);
    inverse = b.over(det);
    return trace > S(0) && det > S(0) ? det / trace : S(0);
  }

  void take_lack(const S& lack) {
    if (!(lack > S(0))) return;
    damped_ = true;
    if (lack > lack_) lack_ = lack < S(1) ? lack : S(1);
  }

  FLEXCOMP_RARE S solve_limited(const Vec3<S>& u, const Vec3<S>& v, const Vec3<S>& w, S largest,
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
  S lack_ = S(0);
  bool damped_ = false;
};

}  // namespace detail
}  // namespace flexcomp

#endif
