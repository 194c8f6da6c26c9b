/// \file
/// How far the joints yield: torques of the load and levers of the links' own weight, carried link by link in the
/// links' own frames, and what else turns a joint. For the control cycle, and only for sets whose effects all turn
/// joints (Model::only_joints_yield()).
///
/// The torques are those of forward.hpp (Chen et al. 2019, Eq. 10-13), where the load is one force and one moment in
/// F0. Here gravity goes outward and the moment inward (the static part of the recursive Newton-Euler method, Luh,
/// Walker and Paul 1980), which needs neither axes nor origins in F0 and half as many operations; core_yield_test
/// holds the two together.
#ifndef FLEXCOMP_JOINT_YIELD_HPP
#define FLEXCOMP_JOINT_YIELD_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/forward.hpp"
#include "flexcomp/rigid_chain.hpp"

namespace flexcomp {
namespace detail {

/// The load of one control cycle.
template <class S>
struct CarriedLoad {
  S mass_kg;
  Triple<S> com_m;         ///< in the flange frame
  Triple<S> force_n;       ///< external, at the tool point, in F0
  bool has_force = false;  ///< external
};

template <class S, std::size_t N, class Cap>
inline CarriedLoad<S> carried_load(const Model<S, N, Cap>& model, const Context<S, N>& context) {
  const std::array<S, 4>& edit = model.load_edit();
  CarriedLoad<S> load;
  load.mass_kg = context.payload_kg + edit[slot::mass];
  load.com_m = {context.payload_com_m[0] + edit[slot::com_x], context.payload_com_m[1] + edit[slot::com_y],
                context.payload_com_m[2] + edit[slot::com_z]};
  load.force_n = {context.force_n[0], context.force_n[1], context.force_n[2]};
  load.has_force = load.force_n.x < S(0) || load.force_n.x > S(0) || load.force_n.y < S(0) ||
                   load.force_n.y > S(0) || load.force_n.z < S(0) || load.force_n.z > S(0);
  return load;
}

/// From the frame before a link's joint into the one between its Rot(z) and its Trans.
template <class S>
inline Triple<S> into_middle(const SinCos<S>& theta, const Triple<S>& v) {
  return {theta.c * v.x + theta.s * v.y, theta.c * v.y - theta.s * v.x, v.z};
}
/// From there into the frame after the link, directions only.
template <class S>
inline Triple<S> into_end(const LinkShape<S>& link, const Triple<S>& v) {
  const S y = link.alpha.c * v.y + link.alpha.s * v.z;
  const S z = link.alpha.c * v.z - link.alpha.s * v.y;
  if (!link.has_beta) return {v.x, y, z};
  return {link.beta.c * v.x - link.beta.s * z, y, link.beta.c * z + link.beta.s * v.x};
}
/// The ways back.
template <class S>
inline Triple<S> out_of_end(const LinkShape<S>& link, const Triple<S>& v) {
  S x = v.x, z = v.z;
  if (link.has_beta) {
    x = link.beta.c * v.x + link.beta.s * v.z;
    z = link.beta.c * v.z - link.beta.s * v.x;
  }
  return {x, link.alpha.c * v.y - link.alpha.s * z, link.alpha.s * v.y + link.alpha.c * z};
}
template <class S>
inline Triple<S> out_of_middle(const SinCos<S>& theta, const Triple<S>& v) {
  return {theta.c * v.x - theta.s * v.y, theta.s * v.x + theta.c * v.y, v.z};
}

/// Gravity in each link's middle frame and the load's torque about each joint.
template <class S, std::size_t N>
struct LinkLoads {
  std::array<Triple<S>, N> gravity;  ///< m/s^2
  std::array<S, N> torque;           ///< N·m
};

template <class S, std::size_t N, class Cap>
inline void carry_load(const Model<S, N, Cap>& model, const std::array<SinCos<S>, N>& angle,
                       const CarriedLoad<S>& load, LinkLoads<S, N>& out) {
  const std::array<LinkShape<S>, N>& links = model.shapes();
  Triple<S> g = triple<S>(model.gravity());
  for (std::size_t i = 0; i < N; ++i) {
    g = into_middle(angle[i], g);
    out.gravity[i] = g;
    g = into_end(links[i], g);
  }
  const S mass = load.mass_kg;
  Triple<S> moment = cross(load.com_m, g * mass);
  if (!load.has_force) {
    for (std::size_t i = N; i-- > 0;) {
      const LinkShape<S>& link = links[i];
      const Triple<S>& at = out.gravity[i];
      const S da = link.d * mass, aa = link.a * mass;
      moment = out_of_end(link, moment);
      moment.x -= da * at.y;
      moment.y += da * at.x;
      moment.y -= aa * at.z;
      moment.z += aa * at.y;
      out.torque[i] = moment.z;
      moment = out_of_middle(angle[i], moment);
    }
    return;
  }
  std::array<Triple<S>, N> force;
  Triple<S> f = load.force_n;
  for (std::size_t i = 0; i < N; ++i) {
    f = into_middle(angle[i], f);
    force[i] = f + out.gravity[i] * mass;
    f = into_end(links[i], f);
  }
  moment = moment + cross(triple<S>(model.tool_pose().position), f);
  for (std::size_t i = N; i-- > 0;) {
    const LinkShape<S>& link = links[i];
    const Triple<S>& at = force[i];
    moment = out_of_end(link, moment);
    moment.x -= link.d * at.y;
    moment.y += link.d * at.x - link.a * at.z;
    moment.z += link.a * at.y;
    out.torque[i] = moment.z;
    moment = out_of_middle(angle[i], moment);
  }
}

/// link_weight_lever() of forward.hpp, taken in the middle frame of the joint's link.
template <class S, std::size_t N, class Cap>
inline S carried_lever(const Model<S, N, Cap>& model, const std::array<SinCos<S>, N>& angle,
                       const LinkLoads<S, N>& loads, std::size_t joint, std::size_t far) {
  const std::array<LinkShape<S>, N>& links = model.shapes();
  S x = links[joint].a, y = S(0);
  if (far > joint + 1) {
    Triple<S> arm = {S(0), S(0), S(0)};
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
  const Triple<S>& g = loads.gravity[joint];
  const S square = x * x + y * y;
  if (!(square > S(1e-6))) return S(0);
  using std::sqrt;
  return (x * g.y - y * g.x) * model.inverse_gravity() / sqrt(square);
}

/// A function of a joint's reading around one reading: value, slope per rad and half the curvature.
template <class S>
struct Local {
  S value, slope, half_curvature;
};

/// The cubic of the cell in which the reading lies (curve_weights() of forward.hpp in powers of the distance).
template <class S, std::size_t N, class Cap>
inline Local<S> local_curve(const Model<S, N, Cap>& model, const Term<S>& term, const S& q) {
  const Table& table = model.table(term.table);
  const S* c = model.values(table);
  const std::int32_t m = table.size;
  const S per_rad = S(static_cast<float>(table.size)) * S(0.15915494309189533577);
  const S t = q * per_rad;
  std::int32_t k = 0;
  // As in curve_weights(): far inside 32 bits, and a NaN gives k = 0.
  if (t > S(-1e7F) && t < S(1e7F)) k = truncate(t);
  S u = t - S(static_cast<float>(k));
  if (u < S(0)) {
    u += S(1);
    --k;
  }
  std::int32_t first = (k - 1) % m;
  if (first < 0) first += m;
  S c0 = c[first], c1, c2, c3;
  if (first + 3 < m) {
    c1 = c[first + 1];
    c2 = c[first + 2];
    c3 = c[first + 3];
  } else {
    c1 = c[(first + 1) % m];
    c2 = c[(first + 2) % m];
    c3 = c[(first + 3) % m];
  }
  const S middle = c1 + c1;
  const S p2 = (c0 - middle + c2) * S(0.5);
  const S p1 = (c2 - c0) * S(0.5);
  const S p0 = (c0 + middle + middle + c2) * S(1.0 / 6);
  const S p3 = (c3 - c0) * S(1.0 / 6) + (c1 - c2) * S(0.5);
  const S k3 = p3 * u;
  const S bend = p2 + k3 + k3 + k3;  // half the second derivative
  return {p0 + u * (p1 + u * (p2 + k3)), (p1 + u * (bend + p2)) * per_rad, bend * per_rad * per_rad};
}

/// What the load and the links' own weight do to every joint (rad): compliances, levers, and curves times torque.
template <class S, std::size_t N, class Cap>
inline void loaded_yield(const Model<S, N, Cap>& model, const std::array<S, N>& q,
                         const std::array<SinCos<S>, N>& angle, const CarriedLoad<S>& load,
                         std::array<S, N>& delta) {
  LinkLoads<S, N> loads;
  carry_load(model, angle, load, loads);
  for (std::size_t i = 0; i < N; ++i) delta[i] = model.compliance(i) * loads.torque[i];
  std::size_t joint = N, far = N;
  S lever = S(0);
  for (std::size_t k = 0; k < model.lever_count(); ++k) {
    const Term<S>& term = model.lever_term(k);
    // Equal levers stand side by side.
    const std::size_t term_far = static_cast<std::size_t>(truncate(term.argument));
    if (term.joint != joint || term_far != far) {
      joint = term.joint;
      far = term_far;
      lever = carried_lever(model, angle, loads, joint, far);
    }
    delta[term.place.body - 1U] += term.coefficient * lever;
  }
  for (std::size_t k = 0; k < model.other_loaded_count(); ++k) {
    const Term<S>& term = model.other_loaded_term(k);
    const S torque = loads.torque[term.joint];
    S value = term.coefficient * torque;
    if (term.basis == Basis::load_torque_cubed) {
      value *= torque * torque;
    } else if (term.basis == Basis::curve) {
      value *= local_curve(model, term, q[term.joint]).value;
    }
    delta[term.place.body - 1U] += value;
  }
}

/// What a term of Model::own_term() does, and how it goes on beside this reading.
template <class S, std::size_t N, class Cap>
inline Local<S> own_yield(const Model<S, N, Cap>& model, const Term<S>& term, const S& q,
                          const Context<S, N>& context) {
  S k = term.coefficient;
  if (term.basis == Basis::curve) {
    if (term.factor == Factor::temperature) k *= context.temperature_c - model.reference_temperature();
    if (term.factor == Factor::payload) k *= context.payload_kg;
    const Local<S> at = local_curve(model, term, q);
    return {k * at.value, k * at.slope, k * at.half_curvature};
  }
  if (term.basis == Basis::reading) return {k * q, k, S(0)};
  const S order = term.argument;
  const SinCos<S> wave = sin_cos(order * q);
  const S half = S(-0.5) * k * order * order;
  if (term.basis == Basis::sine) return {k * wave.s, k * order * wave.c, half * wave.s};
  return {k * wave.c, -k * order * wave.s, half * wave.c};
}

}  // namespace detail
}  // namespace flexcomp

#endif
