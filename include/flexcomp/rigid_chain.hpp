/// \file
/// The chain with its constant terms alone, as the control cycle needs it: axes and origins of the joints and the
/// flange, written out in scalars so that a link stays in the processor's registers.
#ifndef FLEXCOMP_RIGID_CHAIN_HPP
#define FLEXCOMP_RIGID_CHAIN_HPP

#include <array>
#include <cstddef>

#include "flexcomp/model.hpp"
#include "flexcomp/trigonometry.hpp"

namespace flexcomp {
namespace detail {

/// Joint i (from 0) turns about `axis` through `origin`; all in F0, m.
template <class S>
struct JointAxis {
  Triple<S> axis;
  Triple<S> origin;
};

template <class S>
struct FlangePose {
  ThreeTriples<S> axes;  ///< columns of its rotation
  Triple<S> origin;
};

/// Carries the chain from F0 to the flange. `angle` are the sines and cosines with the links' offsets.
template <class S, std::size_t N>
inline void rigid_pass(const std::array<LinkShape<S>, N>& links, const std::array<SinCos<S>, N>& angle,
                       std::array<JointAxis<S>, N>& joints, FlangePose<S>& flange) {
  // The first link starts from the axes of F0, which leaves little of it.
  const LinkShape<S>& first = links[0];
  joints[0] = {{S(0), S(0), S(1)}, {S(0), S(0), S(0)}};
  S xx = angle[0].c, xy = angle[0].s, xz = S(0);
  S px = first.a * xx, py = first.a * xy, pz = first.d;
  S yz = first.alpha.s, zz = first.alpha.c;
  S yx = -xy * zz, yy = xx * zz;
  S zx = xy * yz, zy = -xx * yz;
  if (first.has_beta) {
    const S cb = first.beta.c, sb = first.beta.s;
    xz = -sb * zz;
    zz = cb * zz;
    S t = xx;
    xx = cb * xx - sb * zx;
    zx = cb * zx + sb * t;
    t = xy;
    xy = cb * xy - sb * zy;
    zy = cb * zy + sb * t;
  }
  for (std::size_t i = 1; i < N; ++i) {
    const LinkShape<S>& link = links[i];
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

/// How the constant terms move the flange of the nominal chain, to first order: twists carried from the flange to F0,
/// where the motion is given at the origin. `angle` as in the nominal rigid_pass().
template <class S, std::size_t N, class Cap>
inline void constant_twist(const Model<S, N, Cap>& model, const std::array<SinCos<S>, N>& angle,
                           Twist<S>& out) {
  S vx = S(0), vy = S(0), vz = S(0);
  S wx = S(0), wy = S(0), wz = S(0);
  for (std::size_t i = N; i-- > 0;) {
    const LinkShape<S>& link = model.nominal(i);
    const Twist<S>& own = model.link_twist(i);
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

}  // namespace detail
}  // namespace flexcomp

#endif
