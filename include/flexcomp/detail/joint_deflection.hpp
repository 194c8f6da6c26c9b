// SPDX-License-Identifier: Apache-2.0
/// \file
/// Joint deflections by loads and link weight (docs/compensation.md, C12 and C13), for sets whose effects all
/// turn joints (Model::has_only_joint_deflections()).
///
/// The torques are those of forward.hpp (M11), where the load is one force and one moment in F0. Here gravity
/// is propagated outward and the moment inward in the links' own frames: the static part of the recursive
/// Newton-Euler method (Luh, Walker and Paul 1980). It needs neither axes nor origins in F0 and half as many
/// operations; core_joint_deflection_test compares the two.
#ifndef FLEXCOMP_DETAIL_JOINT_DEFLECTION_HPP
#define FLEXCOMP_DETAIL_JOINT_DEFLECTION_HPP

#include <array>
#include <cstddef>

#include "flexcomp/detail/own_deflection.hpp"
#include "flexcomp/detail/rigid_chain.hpp"

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
};

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

/// A uniform field in each link's middle frame, and the torque about each joint per unit of mass or force
/// (C12).
template <class S, std::size_t N>
struct LinkLoads {
  std::array<Vec3<S>, N> field;
  std::array<S, N> torque;
};

/// Propagates a field of F0 outward, and inward its moment on `arm` (flange frame, m), as in (C12). Work: two
/// passes.
template <class S, std::size_t N>
inline void propagate_statics(const std::array<LinkShape<S>, N>& links, const std::array<SinCos<S>, N>& angle,
                              const Vec3<S>& field, const Vec3<S>& arm, LinkLoads<S, N>& out) {
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
  return (x * g.y - y * g.x) * model.inverse_gravity() / sqrt(square);
}

template <class S, std::size_t N, class Cap>
inline void add_force_torques(const Model<S, N, Cap>& model, const std::array<SinCos<S>, N>& angle,
                              const StaticLoad<S>& load, std::array<S, N>& torque, std::array<S, N>& delta) {
  LinkLoads<S, N> of_force;
  propagate_statics(model.shapes(), angle, load.force_n, vec3<S>(model.tool_pose().position), of_force);
  for (std::size_t i = 0; i < N; ++i) {
    torque[i] += of_force.torque[i];
    delta[i] += model.compliance(i) * of_force.torque[i];
  }
}

/// Adds the deflections by link weight (M14), rad; lever(joint, distal) gives a lever (M13).
template <class S, std::size_t N, class Cap, class Lever>
inline void add_levers(const Model<S, N, Cap>& model, const Lever& lever, std::array<S, N>& delta) {
  const std::size_t count = model.lever_count();
  std::uint32_t which = ~0U;
  S value = S(0);
  for (std::size_t k = 0; k < count; ++k) {
    const Term<S>& term = model.lever_term(k);
    // Equal levers are adjacent.
    const std::uint32_t this_one = (std::uint32_t{term.joint} << 16U) | term.distal_joint;
    if (this_one != which) {
      which = this_one;
      value = lever(term.joint, term.distal_joint);
    }
    delta[term.place.body - 1U] += term.coefficient * value;
  }
}
template <class S, std::size_t N, class Cap>
FLEXCOMP_ONCE void add_other_loaded(const Model<S, N, Cap>& model, const std::array<S, N>& q,
                                    const std::array<S, N>& torques, std::array<S, N>& delta) {
  for (std::size_t k = 0; k < model.other_loaded_count(); ++k) {
    const Term<S>& term = model.other_loaded_term(k);
    const S torque = torques[term.joint];
    S value = term.coefficient * torque;
    if (term.basis == Basis::load_torque_cubed) {
      value *= torque * torque;
    } else if (term.basis == Basis::curve) {
      Expansion<S> at = {S(0), S(0), S(0)};
      expand_curve(model, term, q[term.joint], S(1), at);
      value *= at.value;
    }
    delta[term.place.body - 1U] += value;
  }
}

/// Deflection of every joint by load and link weight, rad: compliances (M12), levers (M14), curves times
/// torque.
template <class S, std::size_t N, class Cap>
FLEXCOMP_ONCE void load_deflection(const Model<S, N, Cap>& model, const std::array<S, N>& q,
                                   const std::array<SinCos<S>, N>& angle, const StaticLoad<S>& load,
                                   std::array<S, N>& delta) {
  LinkLoads<S, N> loads;
  propagate_statics(model.shapes(), angle, load.gravity, load.com_m, loads);
  const S mass = load.mass_kg;
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) {
    const S torque = loads.torque[i] * mass;
    loads.torque[i] = torque;
    delta[i] = model.compliance(i) * torque;
  }
  if (load.has_force) add_force_torques(model, angle, load, loads.torque, delta);
  add_levers(
      model,
      [&](std::size_t joint, std::size_t distal) {
        return lever_in_link_frame(model, angle, loads, joint, distal);
      },
      delta);
  if (model.other_loaded_count() != 0) add_other_loaded(model, q, loads.torque, delta);
}

/// load_deflection() of a chain whose axes are known, and its first-order change (C13): moments about axes in
/// F0, (M11). Only for gravity along z of F0 and without external force (StaticLoad::is_plain). The change
/// leaves out the second order and the motion of joints between a lever's ends: it is the start of (C15), not
/// its result.
template <class S, std::size_t N>
class LinearisedDeflection {
 public:
  template <class Cap>
  void set(const Model<S, N, Cap>& model, const std::array<S, N>& q,
           const std::array<JointAxis<S>, N>& joints, const FlangePose<S>& flange, const StaticLoad<S>& load,
           std::array<S, N>& delta) {
    const S weight = load.gravity.z * load.mass_kg;
    weight_ = weight;
    Vec3<S> load_at;
    flange_point(flange, load.com_m, load_at);
    const S ax = load_at.x, ay = load_at.y, az = load_at.z;
    for (std::size_t i = 0; i < N; ++i) {
      const JointAxis<S>& j = joints[i];
      const S zx = j.axis.x, zy = j.axis.y, zz = j.axis.z;
      const S rx = ax - j.origin.x, ry = ay - j.origin.y, rz = az - j.origin.z;
      arm_[i].x = zy * rz - zz * ry;
      arm_[i].y = zz * rx - zx * rz;
      delta[i] = (zx * ry - zy * rx) * weight * model.compliance(i);
    }
    levers_ = 0;
    const S sign = load.gravity.z * model.inverse_gravity();
    add_levers(
        model,
        [&](std::size_t joint, std::size_t distal) {
          const Vec3<S>& z = joints[joint].axis;
          const Vec3<S>&proximal = joints[joint].origin, &end = joints[distal].origin;
          const S rx = end.x - proximal.x, ry = end.y - proximal.y, rz = end.z - proximal.z;
          const S x = z.y * rz - z.z * ry, y = z.z * rx - z.x * rz, h = z.x * ry - z.y * rx;
          const S square = x * x + y * y + h * h;
          using std::sqrt;
          const S k = square > S(1e-6) ? sign / sqrt(square) : S(0);
          if (levers_ < max_levers) {
            lever_[levers_].x = x * k;
            lever_[levers_].y = y * k;
          }
          ++levers_;
          return h * k;
        },
        delta);
    if (model.other_loaded_count() != 0) {
      std::array<S, N> torque;
      for (std::size_t i = 0; i < N; ++i) {
        const JointAxis<S>& j = joints[i];
        torque[i] = (j.axis.x * (ay - j.origin.y) - j.axis.y * (ax - j.origin.x)) * weight;
      }
      add_other_loaded(model, q, torque, delta);
    }
  }

  /// First-order change of the deflection (rad) when the joints turn by `by` (rad).
  template <class Cap>
  void change(const Model<S, N, Cap>& model, const std::array<JointAxis<S>, N>& joints,
              const std::array<S, N>& by, std::array<S, N>& delta) const {
    // The z of axis x arm gives the torque: joints further out move the arm's end, joints further in turn it
    // as a whole.
    S ux = S(0), uy = S(0);
    for (std::size_t i = N; i-- > 0;) {
      const S v = by[i];
      ux += arm_[i].x * v;
      uy += arm_[i].y * v;
      delta[i] = joints[i].axis.x * uy - joints[i].axis.y * ux;
    }
    std::array<Planar, N> turned;
    S wx = S(0), wy = S(0);
    const S weight = weight_;
    for (std::size_t i = 0; i < N; ++i) {
      const S v = by[i];
      S d = delta[i];
      d += wx * arm_[i].y;
      d -= wy * arm_[i].x;
      wx += joints[i].axis.x * v;
      wy += joints[i].axis.y * v;
      turned[i].x = wx;
      turned[i].y = wy;
      delta[i] = d * weight * model.compliance(i);
    }
    if (levers_ > max_levers) return;
    const Planar* next = lever_.data();
    add_levers(
        model,
        [&](std::size_t joint, std::size_t) {
          const Planar& b = *next++;
          return turned[joint].x * b.y - turned[joint].y * b.x;
        },
        delta);
  }

 private:
  struct Planar {
    S x, y;
  };
  static constexpr std::size_t max_levers = 4;

  std::array<Planar, N> arm_;  ///< x, y of axis x (centre of mass - origin)
  /// x, y of axis x (distal - proximal origin) as a unit vector; its z is the lever.
  std::array<Planar, max_levers> lever_;
  std::size_t levers_;
  S weight_;
};

}  // namespace detail
}  // namespace flexcomp

#endif
