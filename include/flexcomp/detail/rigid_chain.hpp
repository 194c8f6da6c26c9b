// SPDX-License-Identifier: Apache-2.0
/// \file
/// Kinematics of the chain with its constant terms alone, for the control cycle: axes, origins, flange, and
/// small motions (docs/model.md, M2 and M17). Written out in scalars so that a link stays in the processor's
/// registers.
#ifndef FLEXCOMP_DETAIL_RIGID_CHAIN_HPP
#define FLEXCOMP_DETAIL_RIGID_CHAIN_HPP

#include <array>
#include <cstddef>
#include <type_traits>

#include "flexcomp/model.hpp"
#include "flexcomp/trigonometry.hpp"

namespace flexcomp {
namespace detail {

/// Axis of a joint: unit direction, and a point of it; in F0, m.
template <class S>
struct JointAxis {
  Vec3<S> axis;
  Vec3<S> origin;
};

/// Pose of the flange frame in F0, m.
template <class S>
struct FlangePose {
  Mat3<S> axes;  ///< columns of its rotation
  Vec3<S> origin;
};

/// Forward kinematics of a rigid chain (M2): axes and origins of its joints, and its flange, in F0. `angle`
/// holds sines and cosines of readings plus offsets; Link is LinkShape or MovedLink. Work: at most 34 multiplications
/// per link.
template <class S, std::size_t N, class Link>
FLEXCOMP_ONCE void rigid_pass(const std::array<Link, N>& links, const std::array<SinCos<S>, N>& angle,
                              std::array<JointAxis<S>, N>& joints, FlangePose<S>& flange) {
  constexpr bool may_tilt = std::is_same<Link, MovedLink<S>>::value;
  // The first link starts from the axes of F0: most products are by 0 or 1.
  const Link& first = links[0];
  joints[0] = {{S(0), S(0), S(1)}, {S(0), S(0), S(0)}};
  S xx = angle[0].c, xy = angle[0].s, xz = S(0);
  S px = first.a * xx, py = first.a * xy, pz = first.d;
  S yz = first.alpha.s, zz = first.alpha.c;
  S yx = -xy * zz, yy = xx * zz;
  S zx = xy * yz, zy = -xx * yz;
  if constexpr (may_tilt) {
    const S cg = first.gamma.c, sg = first.gamma.s;
    // z of the tilted frame is (sg x, cg z), and x is (cg x, -sg z).
    const S sa = yz, ca = zz;
    const S ux = sg * xx, uy = sg * xy;
    yx += sa * ux;
    yy += sa * uy;
    yz = sa * cg;
    zx += ca * ux;
    zy += ca * uy;
    zz = ca * cg;
    xx = cg * xx;
    xy = cg * xy;
    xz = -sg;
  }
  if (first.has_beta) {
    const S cb = first.beta.c, sb = first.beta.s;
    S t = xz;
    xz = cb * xz - sb * zz;
    zz = cb * zz + sb * t;
    t = xx;
    xx = cb * xx - sb * zx;
    zx = cb * zx + sb * t;
    t = xy;
    xy = cb * xy - sb * zy;
    zy = cb * zy + sb * t;
  }
  for (std::size_t i = 1; i < N; ++i) {
    const Link& link = links[i];
    JointAxis<S>& joint = joints[i];
    joint.axis.x = zx;
    joint.axis.y = zy;
    joint.axis.z = zz;
    joint.origin.x = px;
    joint.origin.y = py;
    joint.origin.z = pz;
    const S c = angle[i].c, s = angle[i].s;
    S t = xx;
    xx = c * xx + s * yx;
    yx = c * yx - s * t;
    t = xy;
    xy = c * xy + s * yy;
    yy = c * yy - s * t;
    t = xz;
    xz = c * xz + s * yz;
    yz = c * yz - s * t;
    px += link.d * zx;
    px += link.a * xx;
    py += link.d * zy;
    py += link.a * xy;
    pz += link.d * zz;
    pz += link.a * xz;
    if constexpr (may_tilt) {
      const S cg = link.gamma.c, sg = link.gamma.s;
      t = xx;
      xx = cg * xx - sg * zx;
      zx = cg * zx + sg * t;
      t = xy;
      xy = cg * xy - sg * zy;
      zy = cg * zy + sg * t;
      t = xz;
      xz = cg * xz - sg * zz;
      zz = cg * zz + sg * t;
    }
    const S ca = link.alpha.c, sa = link.alpha.s;
    t = yx;
    yx = ca * yx + sa * zx;
    zx = ca * zx - sa * t;
    t = yy;
    yy = ca * yy + sa * zy;
    zy = ca * zy - sa * t;
    t = yz;
    yz = ca * yz + sa * zz;
    zz = ca * zz - sa * t;
    if (link.has_beta) {
      const S cb = link.beta.c, sb = link.beta.s;
      t = xx;
      xx = cb * xx - sb * zx;
      zx = cb * zx + sb * t;
      t = xy;
      xy = cb * xy - sb * zy;
      zy = cb * zy + sb * t;
      t = xz;
      xz = cb * xz - sb * zz;
      zz = cb * zz + sb * t;
    }
  }
  flange.axes = {{xx, xy, xz}, {yx, yy, yz}, {zx, zy, zz}};
  flange.origin = {px, py, pz};
}

/// Twist of the flange by the constant terms, to first order (C3): at the origin of F0, m and rad. The links'
/// twists are added up from the flange inward. `angle` as in the nominal rigid_pass().
template <class S, std::size_t N, class Cap>
inline void constant_twist(const Model<S, N, Cap>& model, const std::array<SinCos<S>, N>& angle,
                           SmallMotion<S>& out) {
  S vx = S(0), vy = S(0), vz = S(0);
  S wx = S(0), wy = S(0), wz = S(0);
  for (std::size_t i = N; i-- > 0;) {
    const LinkShape<S>& link = model.nominal(i);
    const SmallMotion<S>& own = model.plan().link_twist(i);
    vx += own.linear.x;
    vy += own.linear.y;
    vz += own.linear.z;
    wx += own.angular.x;
    wy += own.angular.y;
    wz += own.angular.z;
    if (link.has_beta) {
      const S cb = link.beta.c, sb = link.beta.s;
      S t = vx;
      vx = cb * vx + sb * vz;
      vz = cb * vz - sb * t;
      t = wx;
      wx = cb * wx + sb * wz;
      wz = cb * wz - sb * t;
    }
    const S ca = link.alpha.c, sa = link.alpha.s;
    S my = ca * vy - sa * vz;
    vz = sa * vy + ca * vz;
    const S ny = ca * wy - sa * wz;
    wz = sa * wy + ca * wz;
    const S d = link.d, a = link.a;
    vx -= d * ny;
    my += d * wx;
    my -= a * wz;
    vz += a * ny;
    const S c = angle[i].c, s = angle[i].s;
    vy = s * vx + c * my;
    vx = c * vx - s * my;
    wy = s * wx + c * ny;
    wx = c * wx - s * ny;
  }
  out.linear = {vx, vy, vz};
  out.angular = {wx, wy, wz};
}

/// Orientation error (C5), sin(angle) times the axis of the rotation from `from` to `to` (columns), in the
/// outer frame; it is the rotation vector to third order.
template <class S>
inline void rotation_error(const Mat3<S>& to, const Mat3<S>& from, Vec3<S>& error) {
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

/// Coordinates in F0 of a point of the flange frame, m.
template <class S>
inline void flange_point(const FlangePose<S>& flange, const Vec3<S>& at, Vec3<S>& point) {
  const S x = at.x, y = at.y, z = at.z;
  const Mat3<S>& f = flange.axes;
  point.x = flange.origin.x + (f.a.x * x + f.b.x * y + f.c.x * z);
  point.y = flange.origin.y + (f.a.y * x + f.b.y * y + f.c.y * z);
  point.z = flange.origin.z + (f.a.z * x + f.b.z * y + f.c.z * z);
}

/// Motion of the tool point (m) and rotation (rad) by joint turns dq (rad), to first order.
template <class S, std::size_t N>
inline void linear_motion(const std::array<JointAxis<S>, N>& joint, const Vec3<S>& tool,
                          const std::array<S, N>& dq, SmallMotion<S>& out) {
  out.linear = out.angular = {S(0), S(0), S(0)};
  for (std::size_t i = 0; i < N; ++i) {
    out.linear = out.linear + cross(joint[i].axis, tool - joint[i].origin) * dq[i];
    out.angular = out.angular + joint[i].axis * dq[i];
  }
}

/// Motion of the tool point (m) and rotation (rad) by joint turns dq (rad), to second order (C6).
template <class S, std::size_t N>
inline void motion(const std::array<JointAxis<S>, N>& joint, const Vec3<S>& tool, const std::array<S, N>& dq,
                   SmallMotion<S>& out) {
  // From the flange inward: each joint turns the motion of those further out.
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

/// Sines and cosines of readings plus the links' offsets. The readings are within the limits of a Model, thus
/// in the range of the kernel.
template <class S, std::size_t N>
FLEXCOMP_ONCE void sin_cos_all(const std::array<S, N>& q, const std::array<LinkShape<S>, N>& links,
                               std::array<SinCos<S>, N>& angle) {
  for (std::size_t i = 0; i < N; ++i) {
    S s, c;
    sin_cos_kernel(q[i], s, c);
    const S os = links[i].offset.s, oc = links[i].offset.c;
    angle[i].s = s * oc + c * os;
    angle[i].c = c * oc - s * os;
  }
}

/// rotate_all() for turns of any size.
template <class S, std::size_t N>
FLEXCOMP_RARE void rotate_all_large(std::array<SinCos<S>, N>& angle, const std::array<S, N>& by) {
  for (std::size_t i = 0; i < N; ++i) angle[i] = rotate(angle[i], by[i]);
}

/// Adds turns to all angles; `square` is their sum of squares, rad^2. Without the last terms of rotate(),
/// which are below 1e-11 up to 1/64 rad.
template <class S, std::size_t N>
FLEXCOMP_ONCE void rotate_all(std::array<SinCos<S>, N>& angle, const std::array<S, N>& by, S square) {
  if (!(square < S(0.000244140625))) {
    rotate_all_large(angle, by);
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

}  // namespace detail
}  // namespace flexcomp

#endif
