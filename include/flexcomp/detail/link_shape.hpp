// SPDX-License-Identifier: Apache-2.0
/// \file
/// Constant part of a link (M2), the small transform (M3) and the twist between two poses (M17) of
/// docs/model.md.
#ifndef FLEXCOMP_DETAIL_LINK_SHAPE_HPP
#define FLEXCOMP_DETAIL_LINK_SHAPE_HPP

#include <array>
#include <cstddef>

#include "flexcomp/linear.hpp"
#include "flexcomp/term.hpp"
#include "flexcomp/trigonometry.hpp"

namespace flexcomp {

/// Constant part of a link (M2): Rot(z, q + offset) Trans(z,d) Trans(x,a) Rot(x,alpha) Rot(y,beta).
template <class S>
struct LinkShape {
  SinCos<S> offset{S(0), S(1)};  ///< of theta, added to the reading
  SinCos<S> alpha{S(0), S(1)};   ///< of alpha
  SinCos<S> beta{S(0), S(1)};    ///< of beta
  S d = S(0);                    ///< m
  S a = S(0);                    ///< m
  bool has_beta = false;         ///< false: Rot(y,beta) is left out
};

/// Link whose slots effects have moved: gamma as well, Rot(z) Trans(z,d) Trans(x,a) Rot(y,gamma) Rot(x,alpha)
/// Rot(y,beta).
template <class S>
struct MovedLink {
  SinCos<S> gamma;  ///< of gamma
  SinCos<S> alpha;  ///< of alpha
  SinCos<S> beta;   ///< of beta
  S d;              ///< m
  S a;              ///< m
  bool has_beta;    ///< false: Rot(y,beta) is left out
};

/// Small rigid motion (M17): of the point at the origin of its frame, and about it.
template <class S>
struct SmallMotion {
  Vec3<S> linear;   ///< m
  Vec3<S> angular;  ///< rotation vector, rad
};

/// Rigid transform of six values x, y, z, rx, ry, rz (M3): Trans(x,y,z) Rot(z,rz) Rot(y,ry) Rot(x,rx); m and
/// rad.
template <class S>
inline Pose<S> small_pose(const std::array<S, 6>& v) {
  const SinCos<S> x = sin_cos(v[slot::rx]);
  const SinCos<S> y = sin_cos(v[slot::ry]);
  const SinCos<S> z = sin_cos(v[slot::rz]);
  Pose<S> pose;
  pose.rotation << z.c * y.c, z.c * y.s * x.s - z.s * x.c, z.c * y.s * x.c + z.s * x.s,  //
      z.s * y.c, z.s * y.s * x.s + z.c * x.c, z.s * y.s * x.c - z.c * x.s,               //
      -y.s, y.c * x.s, y.c * x.c;
  pose.position = Vector3<S>(v[0], v[1], v[2]);
  return pose;
}

/// Small motion (M17) from the first pose's frame to the second one's, in the first frame and to first order.
template <class S>
inline SmallMotion<S> twist_between(const Pose<S>& from, const Pose<S>& to) {
  const Matrix3<S>& r = from.rotation;
  const Vec3<S> shift = vec3<S>(to.position) - vec3<S>(from.position);
  const auto into = [&r](const Vec3<S>& v) {
    return Vec3<S>{r(0, 0) * v.x + r(1, 0) * v.y + r(2, 0) * v.z,
                   r(0, 1) * v.x + r(1, 1) * v.y + r(2, 1) * v.z,
                   r(0, 2) * v.x + r(1, 2) * v.y + r(2, 2) * v.z};
  };
  Vec3<S> turn = {S(0), S(0), S(0)};
  for (int k = 0; k < 3; ++k) {
    turn = turn + cross(Vec3<S>{r(0, k), r(1, k), r(2, k)},
                        Vec3<S>{to.rotation(0, k), to.rotation(1, k), to.rotation(2, k)});
  }
  return {into(shift), into(turn * S(0.5))};
}

/// Pose of a link (M2) at the joint reading 0, with theta as given.
template <class S>
inline Pose<S> link_at_zero(const LinkShape<S>& link, const SinCos<S>& theta) {
  Pose<S> p;
  const SinCos<S>&a = link.alpha, &b = link.beta;
  p.position = Vector3<S>(link.a * theta.c, link.a * theta.s, link.d);
  // Rot(z) Rot(x) Rot(y)
  p.rotation << theta.c * b.c - theta.s * a.s * b.s, -theta.s * a.c, theta.c * b.s + theta.s * a.s * b.c,
      theta.s * b.c + theta.c * a.s * b.s, theta.c * a.c, theta.s * b.s - theta.c * a.s * b.c,  //
      -a.c * b.s, a.s, a.c * b.c;
  return p;
}

}  // namespace flexcomp

#endif
