// SPDX-License-Identifier: Apache-2.0
/// \file
/// Torques, moments and levers of the load in the links' own frames (docs/compensation.md, C12).
///
/// They are those of forward.hpp (M10 to M13), where the load is one force and one moment in F0. Here gravity is
/// propagated outward and the moment inward: the static part of the recursive Newton-Euler method (Luh, Walker and
/// Paul 1980). It needs neither axes nor origins in F0 and half as many operations; core/joint_deflection_test
/// compares the two.
#ifndef FLEXCOMP_DETAIL_STATICS_HPP
#define FLEXCOMP_DETAIL_STATICS_HPP

#include <array>
#include <cstddef>

#include "flexcomp/detail/rigid_chain.hpp"
#include "flexcomp/model.hpp"

namespace flexcomp {
namespace detail {

/// Payload, gravity and external force of one control cycle (M8).
template <class S>
struct StaticLoad {
  S mass_kg;
  Vec3<S> gravity;         ///< m/s^2, in F0
  Vec3<S> com_m;           ///< in the flange frame
  Vec3<S> force_n;         ///< external, at the tool point, in F0
  bool has_force = false;  ///< external
  bool is_plain = false;   ///< no external force, and gravity along z of F0

  /// Weight and external force, N, in F0.
  Vec3<S> total_force() const { return gravity * mass_kg + force_n; }
};

/// Loads of a context, with the model's change of the payload.
template <class S, std::size_t N, class Cap>
inline void static_load(const Model<S, N, Cap>& model, const Context<S, N>& context, StaticLoad<S>& load) {
  const std::array<S, 4>& edit = model.load_edit();
  load.mass_kg = context.payload_kg + edit[slot::mass];
  load.gravity = vec3<S>(model.gravity());
  load.com_m = {context.payload_com_m[0] + edit[slot::com_x], context.payload_com_m[1] + edit[slot::com_y],
                context.payload_com_m[2] + edit[slot::com_z]};
  load.force_n = {context.force_n[0], context.force_n[1], context.force_n[2]};
  const Vec3<S>& f = load.force_n;
  load.has_force = f.x * f.x + f.y * f.y + f.z * f.z > S(0);
  load.is_plain = !load.has_force && model.has_axial_gravity();
}

/// Coordinates of a direction: from the frame after a link to the middle frame, between its Rot(z) and its
/// Trans.
template <class S>
inline Vec3<S> link_end_to_middle(const LinkShape<S>& link, const Vec3<S>& v) {
  S x = v.x, z = v.z;
  if (link.has_beta) {
    x = link.beta.c * v.x + link.beta.s * v.z;
    z = link.beta.c * v.z - link.beta.s * v.x;
  }
  return {x, link.alpha.c * v.y - link.alpha.s * z, link.alpha.s * v.y + link.alpha.c * z};
}
/// Coordinates of a direction: from the middle frame to the frame before the link's joint.
template <class S>
inline Vec3<S> middle_to_link_start(const SinCos<S>& theta, const Vec3<S>& v) {
  return {theta.c * v.x - theta.s * v.y, theta.s * v.x + theta.c * v.y, v.z};
}

/// A uniform field in the links' frames, and the torques and moments of a force along it (C12).
template <class S, std::size_t N>
struct LinkLoads {
  std::array<Vec3<S>, N> field;    ///< in each link's middle frame
  std::array<S, N> torque;         ///< about each joint
  std::array<S, N> moment_x;       ///< at the end of each link, about x of the frame there
  std::array<S, N> moment_y;       ///< about its y
  S base_moment_x, base_moment_y;  ///< about x and y of F0, at its origin

  /// Adds the torques and moments of another force.
  void add(const LinkLoads& b) {
    for (std::size_t i = 0; i < N; ++i) {
      torque[i] += b.torque[i];
      moment_x[i] += b.moment_x[i];
      moment_y[i] += b.moment_y[i];
    }
    base_moment_x += b.base_moment_x;
    base_moment_y += b.base_moment_y;
  }
};

/// Propagates a field of F0 outward, and inward its moment on `arm` (flange frame, m), as in (C12). Work: two
/// passes.
template <class S, std::size_t N>
FLEXCOMP_ONCE void propagate_statics(const std::array<LinkShape<S>, N>& links,
                                     const std::array<SinCos<S>, N>& angle, const Vec3<S>& field,
                                     const Vec3<S>& arm, LinkLoads<S, N>& out) {
  S x = field.x, y = field.y, z = field.z;
  for (std::size_t i = 0; i < N; ++i) {
    const LinkShape<S>& link = links[i];
    const S c = angle[i].c, s = angle[i].s;
    const S mx = c * x + s * y;
    const S my = c * y - s * x;
    out.field[i].x = mx;
    out.field[i].y = my;
    out.field[i].z = z;
    const S ca = link.alpha.c, sa = link.alpha.s;
    x = mx;
    y = ca * my + sa * z;
    z = ca * z - sa * my;
    if (link.has_beta) {
      const S t = x;
      x = link.beta.c * x - link.beta.s * z;
      z = link.beta.c * z + link.beta.s * t;
    }
  }
  S nx = arm.y * z - arm.z * y;
  S ny = arm.z * x - arm.x * z;
  S nz = arm.x * y - arm.y * x;
  for (std::size_t i = N; i-- > 0;) {
    const LinkShape<S>& link = links[i];
    out.moment_x[i] = nx;
    out.moment_y[i] = ny;
    if (link.has_beta) {
      const S t = nx;
      nx = link.beta.c * nx + link.beta.s * nz;
      nz = link.beta.c * nz - link.beta.s * t;
    }
    const S ca = link.alpha.c, sa = link.alpha.s;
    S my = ca * ny - sa * nz;
    nz = sa * ny + ca * nz;
    const S fx = out.field[i].x, fy = out.field[i].y, fz = out.field[i].z;
    const S d = link.d, a = link.a;
    nx -= d * fy;
    my += d * fx;
    my -= a * fz;
    nz += a * fy;
    out.torque[i] = nz;
    const S c = angle[i].c, s = angle[i].s;
    ny = s * nx + c * my;
    nx = c * nx - s * my;
  }
  out.base_moment_x = nx;
  out.base_moment_y = ny;
}

/// Link-weight lever (M13) of a joint, in the middle frame of its link.
template <class S, std::size_t N, class Cap>
inline S lever_in_link_frame(const Model<S, N, Cap>& model, const std::array<SinCos<S>, N>& angle,
                             const LinkLoads<S, N>& loads, std::size_t joint, std::size_t distal) {
  const std::array<LinkShape<S>, N>& links = model.shapes();
  S x = links[joint].a, y = S(0);
  if (distal > joint + 1) {
    Vec3<S> arm = {S(0), S(0), S(0)};
    for (std::size_t k = distal - 1; k > joint; --k) {
      arm = link_end_to_middle(links[k], arm);
      arm.x += links[k].a;
      arm.z += links[k].d;
      arm = middle_to_link_start(angle[k], arm);
    }
    arm = link_end_to_middle(links[joint], arm);
    x += arm.x;
    y = arm.y;
  }
  const Vec3<S>& g = loads.field[joint];
  const S square = x * x + y * y;
  if (!(square > S(1e-6))) return S(0);
  using std::sqrt;
  return (x * g.y - y * g.x) * model.plan().inverse_gravity() / sqrt(square);
}

/// Adds the torques and moments of the external force.
template <class S, std::size_t N, class Cap>
FLEXCOMP_ONCE void add_force(const Model<S, N, Cap>& model, const std::array<SinCos<S>, N>& angle,
                             const StaticLoad<S>& load, LinkLoads<S, N>& out) {
  LinkLoads<S, N> of_force;
  propagate_statics(model.shapes(), angle, load.force_n, vec3<S>(model.tool_pose().position), of_force);
  out.add(of_force);
}

/// Loads of one instant (C12) for the readings whose sines and cosines are in `angle`: gravity's field and, in N·m, the
/// torques and moments of payload and external force.
template <class S, std::size_t N, class Cap>
FLEXCOMP_ONCE void compute_loads(const Model<S, N, Cap>& model, const std::array<SinCos<S>, N>& angle,
                                 const StaticLoad<S>& load, LinkLoads<S, N>& out) {
  propagate_statics(model.shapes(), angle, load.gravity, load.com_m, out);
  const S mass = load.mass_kg;
  for (S& t : out.torque) t *= mass;
  if (model.plan().needs_moments()) {
    for (std::size_t i = 0; i < N; ++i) {
      out.moment_x[i] *= mass;
      out.moment_y[i] *= mass;
    }
    out.base_moment_x *= mass;
    out.base_moment_y *= mass;
  }
  if (load.has_force) add_force(model, angle, load, out);
}

/// Adds the deflections by link weight (M14), rad; lever(joint, distal) gives a lever (M13).
template <class S, std::size_t N, class Cap, class Lever>
inline void add_levers(const Model<S, N, Cap>& model, const Lever& lever, std::array<S, N>& delta) {
  const std::size_t count = model.plan().size(group::lever);
  std::uint32_t which = ~0U;
  S value = S(0);
  for (std::size_t k = 0; k < count; ++k) {
    const Term<S>& term = model.effect_of(group::lever, k);
    // Equal levers are adjacent.
    const std::uint32_t this_one = (std::uint32_t{term.joint} << 16U) | term.distal_joint;
    if (this_one != which) {
      which = this_one;
      value = lever(term.joint, term.distal_joint);
    }
    delta[term.place.body - 1U] += term.coefficient * value;
  }
}

}  // namespace detail
}  // namespace flexcomp

#endif
