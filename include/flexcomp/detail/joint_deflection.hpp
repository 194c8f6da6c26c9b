// SPDX-License-Identifier: Apache-2.0
/// \file
/// How far the joints yield: torques of the load and levers of the links' own weight, carried link by link in the
/// links' own frames, and what else turns a joint. For the control cycle, and only for sets whose effects all turn
/// joints (Model::has_only_joint_deflections()).
///
/// The torques are those of forward.hpp (Chen et al. 2019, Eq. 10-13), where the load is one force and one moment in
/// F0. Here gravity goes outward and the moment inward (the static part of the recursive Newton-Euler method, Luh,
/// Walker and Paul 1980), which needs neither axes nor origins in F0 and half as many operations; core_yield_test
/// holds the two together.
#ifndef FLEXCOMP_DETAIL_JOINT_DEFLECTION_HPP
#define FLEXCOMP_DETAIL_JOINT_DEFLECTION_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/detail/rigid_chain.hpp"
#include "flexcomp/forward.hpp"

namespace flexcomp {
namespace detail {

/// The load of one control cycle.
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
inline void carried_load(const Model<S, N, Cap>& model, const Context<S, N>& context, StaticLoad<S>& load) {
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

/// A direction from the frame after a link into the one between its Rot(z) and its Trans.
template <class S>
inline Vec3<S> out_of_end(const LinkShape<S>& link, const Vec3<S>& v) {
  S x = v.x, z = v.z;
  if (link.has_beta) {
    x = link.beta.c * v.x + link.beta.s * v.z;
    z = link.beta.c * v.z - link.beta.s * v.x;
  }
  return {x, link.alpha.c * v.y - link.alpha.s * z, link.alpha.s * v.y + link.alpha.c * z};
}
/// From there into the frame before the link's joint.
template <class S>
inline Vec3<S> out_of_middle(const SinCos<S>& theta, const Vec3<S>& v) {
  return {theta.c * v.x - theta.s * v.y, theta.s * v.x + theta.c * v.y, v.z};
}

/// A constant force field in each link's middle frame, and the torque about each joint of a unit force of it.
template <class S, std::size_t N>
struct LinkLoads {
  std::array<Vec3<S>, N> field;
  std::array<S, N> torque;
};

/// Carries a field given in F0 outward, and the moment that it has on `arm` (in the flange frame, m) inward.
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

/// link_weight_lever() of forward.hpp, taken in the middle frame of the joint's link.
template <class S, std::size_t N, class Cap>
inline S carried_lever(const Model<S, N, Cap>& model, const std::array<SinCos<S>, N>& angle,
                       const LinkLoads<S, N>& loads, std::size_t joint, std::size_t far) {
  const std::array<LinkShape<S>, N>& links = model.shapes();
  S x = links[joint].a, y = S(0);
  if (far > joint + 1) {
    Vec3<S> arm = {S(0), S(0), S(0)};
    for (std::size_t k = far - 1; k > joint; --k) {
      arm = out_of_end(links[k], arm);
      arm.x += links[k].a;
      arm.z += links[k].d;
      arm = out_of_middle(angle[k], arm);
    }
    arm = out_of_end(links[joint], arm);
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

/// A function of a joint's reading around one reading: value, slope per rad and half the curvature.
template <class S>
struct Local {
  S value, slope, half_curvature;
};

/// Adds k times the cubic of the cell in which the reading lies (curve_weights() of forward.hpp in powers of the
/// distance).
template <class S, std::size_t N, class Cap>
inline void add_local_curve(const Model<S, N, Cap>& model, const Term<S>& term, const S& q, const S& k,
                            Local<S>& sum) {
  const Table& table = model.table(term.table);
  const std::int32_t m = table.size;
  const S per_rad = S(static_cast<float>(table.size)) * S(0.15915494309189533577);
  const S t = q * per_rad;
  std::int32_t cell = 0;
  // As in curve_weights(): far inside 32 bits, and a NaN gives cell 0.
  if (t * t < S(1e14F)) cell = truncate(t);
  S u = t - S(static_cast<float>(cell));
  if (u < S(0)) {
    u += S(1);
    --cell;
  }
  std::int32_t first = (cell - 1) % m;
  if (first < 0) first += m;
  const S* from = model.values(table) + first;
  S c0 = from[0], c1, c2, c3;
  if (first + 3 < m) {
    c1 = from[1];
    c2 = from[2];
    c3 = from[3];
  } else {
    c1 = from[first + 1 < m ? 1 : 1 - m];
    c2 = from[first + 2 < m ? 2 : 2 - m];
    c3 = from[3 - m];
  }
  // p0 + p1 u + p2 u^2 + p3 u^3
  S p3 = (c1 - c2) * S(0.5);
  p3 += (c3 - c0) * S(1.0 / 6);
  S p2 = (c0 + c2) * S(0.5);
  p2 -= c1;
  const S p1 = (c2 - c0) * S(0.5);
  S p0 = p2 * S(1.0 / 3);
  p0 += c1;
  const S bend = u * p3;
  const S half = p2 + bend + bend + bend;  // of the second derivative
  const S value = p1 + u * (p2 + bend);
  sum.value += k * (p0 + u * value);
  const S scale = k * per_rad;
  sum.slope += scale * (p1 + u * (p2 + half));
  sum.half_curvature += scale * per_rad * half;
}

/// Adds what levers and other loaded terms do, once the torques are known; lever(joint, far) gives a lever.
template <class S, std::size_t N, class Cap, class Lever>
inline void add_levers(const Model<S, N, Cap>& model, const Lever& lever, std::array<S, N>& delta) {
  const std::size_t count = model.lever_count();
  std::uint32_t which = ~0U;
  S value = S(0);
  for (std::size_t k = 0; k < count; ++k) {
    const Term<S>& term = model.lever_term(k);
    // Equal levers stand side by side.
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
      Local<S> at = {S(0), S(0), S(0)};
      add_local_curve(model, term, q[term.joint], S(1), at);
      value *= at.value;
    }
    delta[term.place.body - 1U] += value;
  }
}

/// What the load and the links' own weight do to every joint (rad): compliances, levers, and curves times torque.
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
      [&](std::size_t joint, std::size_t far) { return carried_lever(model, angle, loads, joint, far); },
      delta);
  if (model.other_loaded_count() != 0) add_other_loaded(model, q, loads.torque, delta);
}

/// load_deflection() at the angles of a chain whose axes are at hand, and how it changes beside them: moments about the
/// axes in F0, as in forward.hpp. Only for gravity along z of F0 and without external force (StaticLoad::is_plain).
/// The change leaves out what is of second order, and the bend of links between a lever's ends: it is there to start
/// well, not to end with.
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
        [&](std::size_t joint, std::size_t far) {
          const Vec3<S>& z = joints[joint].axis;
          const Vec3<S>&near = joints[joint].origin, &end = joints[far].origin;
          const S rx = end.x - near.x, ry = end.y - near.y, rz = end.z - near.z;
          const S x = z.y * rz - z.z * ry, y = z.z * rx - z.x * rz, h = z.x * ry - z.y * rx;
          const S square = x * x + y * y + h * h;
          using std::sqrt;
          const S k = square > S(1e-6) ? sign / sqrt(square) : S(0);
          if (levers_ < most_levers) {
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

  /// By how much the yield changes (rad) when the joints turn by `by`.
  template <class Cap>
  void change(const Model<S, N, Cap>& model, const std::array<JointAxis<S>, N>& joints,
              const std::array<S, N>& by, std::array<S, N>& delta) const {
    // The arm's z is what the weight turns a joint by; outer joints move its end, inner ones turn it as a whole.
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
    if (levers_ > most_levers) return;
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
  static constexpr std::size_t most_levers = 4;

  std::array<Planar, N> arm_;  ///< x, y of axis x (centre of mass - origin)
  std::array<Planar, most_levers>
      lever_;  ///< x, y of axis x (far - near) as a unit vector; its z is the lever
  std::size_t levers_;
  S weight_;
};

/// Adds what a term of Model::own_term() does, and how it goes on beside this reading.
template <class S, std::size_t N, class Cap>
inline void add_own_yield(const Model<S, N, Cap>& model, const Term<S>& term, const S& q,
                          const Context<S, N>& context, Local<S>& sum) {
  S k = term.coefficient;
  if (term.basis == Basis::curve) {
    if (term.factor == Factor::temperature) k *= context.temperature_c - model.reference_temperature();
    if (term.factor == Factor::payload) k *= context.payload_kg;
    add_local_curve(model, term, q, k, sum);
  } else if (term.basis == Basis::joint_position) {
    sum.value += k * q;
    sum.slope += k;
  } else {
    const S order = term.argument;
    const SinCos<S> wave = sin_cos(order * q);
    const bool is_sine = term.basis == Basis::sine;
    const S f = k * (is_sine ? wave.s : wave.c);
    sum.value += f;
    sum.slope += k * order * (is_sine ? wave.c : -wave.s);
    sum.half_curvature -= S(0.5) * order * order * f;
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

}  // namespace detail
}  // namespace flexcomp

#endif
