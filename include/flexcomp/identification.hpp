// SPDX-License-Identifier: Apache-2.0
/// \file
/// Derivatives of the forward model for the coefficients of terms (docs/model.md, section 5).
///
/// column() is the first-order column of the paper's H (M19): unit screw of the place (M18) times the basis.
/// It leaves out that a geometric error also shifts torques and levers. exact_column() adds that and is the
/// derivative of forward() (M20); the two differ by (deflection / reach) of the column.
#ifndef FLEXCOMP_IDENTIFICATION_HPP
#define FLEXCOMP_IDENTIFICATION_HPP

#include <array>
#include <cstddef>

#include "flexcomp/forward.hpp"

namespace flexcomp {

/// Both passes of the forward model at one pose (M15), as columns need them.
template <class S, std::size_t N = 6>
struct Linearisation {
  Workspace<S, N> unloaded;  ///< frames and load of the pass without effects
  Workspace<S, N> loaded;    ///< frames of the pass with them
  Pose<S> pose;              ///< forward(): Ftool in Fb
  Pose<S> base;              ///< B with its effects
  Vector3<S> tool_point;     ///< origin of Ftool in F0, loaded
  Matrix3<S> tool_rotation;  ///< Ftool in F0, loaded
};

/// Unit screw in F0 (M18), at a point.
template <class S>
struct Screw {
  Vector3<S> linear;   ///< velocity of that point per unit of the slot
  Vector3<S> angular;  ///< angular velocity per unit of the slot
};

namespace detail {

/// Axis of one of the six small motions Trans(x,y,z) Rot(z,rz) Rot(y,ry) Rot(x,rx) with values v, in the
/// outer frame.
template <class S>
inline Vector3<S> small_axis(std::uint8_t which, const std::array<S, 6>& v) {
  switch (which) {
    case slot::x:
      return Vector3<S>::UnitX();
    case slot::y:
      return Vector3<S>::UnitY();
    case slot::rz:
    case slot::z:
      return Vector3<S>::UnitZ();
    case slot::ry: {
      const SinCos<S> z = sin_cos(v[slot::rz]);
      return {-z.s, z.c, S(0)};
    }
    default: {
      const SinCos<S> z = sin_cos(v[slot::rz]);
      const SinCos<S> y = sin_cos(v[slot::ry]);
      return {z.c * y.c, z.s * y.c, -y.s};
    }
  }
}

/// Axis and a point on it (rotations) or direction (translations) of a slot of link i (from 0), in F0.
template <class S, std::size_t N, class Cap>
inline Screw<S> link_screw(const Model<S, N, Cap>& model, const Frames<S, N>& frames, const SinCos<S>& angle,
                           std::size_t i, std::uint8_t which, const std::array<S, 6>& delta,
                           const Vector3<S>& at) {
  const Vector3<S> zero = Vector3<S>::Zero();
  const Vector3<S> z = frames.axis(i, 2);
  const auto turn = [&at](const Vector3<S>& axis, const Vector3<S>& point) {
    return Screw<S>{cross<S>(axis, at - point), axis};
  };
  if (which == slot::theta) return turn(z, frames.origin[i]);
  if (which == slot::d) return {z, zero};
  const Vector3<S> x = frames.axis(i, 0) * angle.c + frames.axis(i, 1) * angle.s;
  if (which == slot::a) return {x, zero};
  const Vector3<S>& end = frames.origin[i + 1];
  if (which == slot::gamma) return turn(frames.axis(i, 1) * angle.c - frames.axis(i, 0) * angle.s, end);
  if (which == slot::alpha) {
    if ((model.link_moves(i) & (1U << slot::gamma)) == 0) return turn(x, end);
    const SinCos<S> gamma = sin_cos(delta[slot::gamma]);
    return turn(x * gamma.c - z * gamma.s, end);
  }
  return turn(frames.axis(i + 1, 1), end);
}

}  // namespace detail

/// Evaluates both passes of the model at joint readings q (rad). Work: three chain passes.
template <class S, std::size_t N, class Cap>
inline void linearise(const Model<S, N, Cap>& model, const std::array<S, N>& q_rad,
                      const Context<S, N>& context, Linearisation<S, N>& out) {
  Workspace<S, N>& u = out.unloaded;
  u.q = q_rad;
  for (std::size_t i = 0; i < N; ++i) {
    u.reading[i] = sin_cos(q_rad[i]);
    u.angle[i] = compose(u.reading[i], model.shape(i).offset);
  }
  detail::unloaded_pass(model, u);
  detail::compute_load(model, context, u);
  out.loaded.q = q_rad;
  out.loaded.reading = u.reading;
  out.pose = detail::evaluate(model, context, out.loaded);
  std::array<S, 6> tool = model.tool();
  std::array<S, 6> base = model.base();
  for (std::size_t k = 0; k < 6; ++k) {
    tool[k] += out.loaded.slots.tool[k];
    base[k] += out.loaded.slots.base[k];
  }
  out.base = small_pose(base);
  const Pose<S> end = Pose<S>{out.loaded.frames.rotation[N], out.loaded.frames.origin[N]} *
                      (model.nominal_tool() * small_pose(tool));
  out.tool_point = end.position;
  out.tool_rotation = end.rotation;
}

/// Unit screw of a place (M18) at the origin of Ftool, in Fb: motion of the pose per unit of the slot. m and
/// rad; rows of position, then of orientation (M17). Zero for `load`; for `point` the translation of the
/// measured point.
template <class S, std::size_t N, class Cap>
inline Vector6<S> screw(const Model<S, N, Cap>& model, const Linearisation<S, N>& at, Place place) {
  Vector6<S> r = Vector6<S>::Zero();
  if (place.body == body::load) return r;
  if (place.body == body::base) {
    std::array<S, 6> v = model.base();
    for (std::size_t k = 0; k < 6; ++k) v[k] += at.loaded.slots.base[k];
    const Vector3<S> axis = detail::small_axis(place.slot, v);
    if (place.slot <= slot::z) {
      r.template head<3>() = axis;
    } else {
      r.template head<3>() = cross<S>(axis, at.pose.position - at.base.position);
      r.template tail<3>() = axis;
    }
    return r;
  }
  Vector3<S> linear = Vector3<S>::Zero();
  Vector3<S> angular = Vector3<S>::Zero();
  if (place.body == body::tool) {
    std::array<S, 6> v = model.tool();
    for (std::size_t k = 0; k < 6; ++k) v[k] += at.loaded.slots.tool[k];
    // Rotations of the tool turn about its own origin: they do not move the tool point.
    const Vector3<S> axis =
        at.loaded.frames.rotation[N] * (model.nominal_tool().rotation * detail::small_axis(place.slot, v));
    (place.slot <= slot::z ? linear : angular) = axis;
  } else if (place.body == body::point) {
    linear = at.tool_rotation.col(place.slot);
  } else {
    const std::size_t i = place.body - 1U;
    const Screw<S> s = detail::link_screw(model, at.loaded.frames, at.loaded.deflected[i], i, place.slot,
                                          at.loaded.slots.link[i], at.tool_point);
    linear = s.linear;
    angular = s.angular;
  }
  r.template head<3>() = at.base.rotation * linear;
  r.template tail<3>() = at.base.rotation * angular;
  return r;
}

/// First-order column of a term (M19): 6 rows, m and rad per unit of the coefficient. Zero for terms of the
/// load.
template <class S, std::size_t N, class Cap>
inline Vector6<S> column(const Model<S, N, Cap>& model, const Linearisation<S, N>& at, const Term<S>& term,
                         const Context<S, N>& context) {
  return screw(model, at, term.place) * basis_value(model, term, context, at.unloaded);
}

/// Derivatives of a model's own effects when a constant slot moves the chain and its load: the sum over e of
/// (M20), for every constant place of one pose.
template <class S, std::size_t N = 6>
struct LoadResponse {
  /// 6x6 matrix; rows as in (M17).
  using Matrix6 = Eigen::Matrix<S, 6, 6>;
  bool any = false;   ///< false: no effect follows the load, the rest is not set
  Vector3<S> com;     ///< payload's centre of mass in F0, unloaded, m
  Vector3<S> tool;    ///< origin of Ftool in F0, unloaded, m
  Vector3<S> weight;  ///< of the payload, N
  Vector3<S> force;   ///< external, N
  Matrix6 to_load;    ///< change of the pose per change of the load [force; moment about F0]
  std::array<Matrix6, N>
      to_twist;  ///< [i]: per twist [linear; angular] (about F0) of everything after link i
};

namespace detail {

/// Derivative of a basis that needs the load (M21): per change of the load, and per twist of everything
/// behind a link. The latter differs between the whole basis moving and only the distal point of a lever.
template <class S>
struct BasisResponse {
  Vector6<S> load = Vector6<S>::Zero();   ///< per [force; moment]
  Vector6<S> whole = Vector6<S>::Zero();  ///< per [linear; angular], while frame `frame` moves too
  Vector6<S> part = Vector6<S>::Zero();   ///< the same while only frames up to `distal` move, beyond `frame`
  std::size_t frame = 0;
  std::size_t distal = 0;
};

/// Derivative (M21) of the load moment about a direction fixed in a frame, through a point of it, times a
/// factor.
template <class S>
inline void respond_about(const Load<S>& load, const Vector3<S>& direction, const Vector3<S>& point,
                          const S& factor, BasisResponse<S>& out) {
  const Vector3<S> u = direction * factor;
  const Vector3<S> turned = cross<S>(load.force, u);
  const Vector3<S> moment = load.moment - cross<S>(point, load.force);
  out.load << cross<S>(point, u), u;
  // Direction and point move with the frame; that the load moves as well is in `load`.
  out.whole << -turned, cross<S>(u, moment) - cross<S>(point, turned);
}

/// Derivative of the basis of a term, zero where it needs no load.
template <class S, std::size_t N, class Cap>
inline BasisResponse<S> basis_response(const Model<S, N, Cap>& model, const Term<S>& term,
                                       const Context<S, N>& context, const Workspace<S, N>& ws) {
  BasisResponse<S> r;
  const std::size_t j = term.joint;
  const Frames<S, N>& f = ws.frames;
  const auto about = [&](std::size_t frame, int axis, const S& factor) {
    r.frame = r.distal = frame;
    respond_about<S>(ws.load, f.axis(frame, axis), f.origin[frame], factor, r);
  };
  switch (term.basis) {
    case Basis::load_torque:
      about(j, 2, S(1));
      break;
    case Basis::load_torque_cubed: {
      const S tau = moment_about<S>(ws.load, f.axis(j, 2), f.origin[j]);
      about(j, 2, S(3) * tau * tau);
      break;
    }
    case Basis::load_moment_x:
      about(j + 1, 0, S(1));
      break;
    case Basis::load_moment_y:
      about(j + 1, 1, S(1));
      break;
    case Basis::base_moment_x:
    case Basis::base_moment_y: {
      const Vector3<S> axis = term.basis == Basis::base_moment_x ? Vector3<S>(Vector3<S>::UnitX())
                                                                 : Vector3<S>(Vector3<S>::UnitY());
      respond_about<S>(ws.load, axis, Vector3<S>(S(0), S(0), term.argument), S(1), r);
      break;  // frame 0 never moves
    }
    case Basis::link_weight: {
      const std::size_t distal = term.distal_joint;
      const Vector3<S> z = f.axis(j, 2);
      const Vector3<S> arm = f.origin[distal] - f.origin[j];
      const S along = dot<S>(z, arm);
      const S square = dot<S>(arm, arm) - along * along;
      const S g2 = dot<S>(model.gravity(), model.gravity());
      if (!(square > S(1e-6)) || !(g2 > S(0))) break;
      using std::sqrt;
      const S scale = S(1) / sqrt(square * g2);
      const Vector3<S> pull = cross<S>(model.gravity(), z);
      const Vector3<S> stretch = (pull - (arm - z * along) * (dot<S>(arm, pull) / square)) * scale;
      r.frame = j;
      r.distal = distal;
      r.part << stretch, cross<S>(f.origin[distal], stretch);
      // Turning the lever is turning gravity the other way.
      r.whole.template tail<3>() = cross<S>(model.gravity(), cross<S>(z, arm)) * -scale;
      break;
    }
    case Basis::curve:
      if (term.factor == Factor::load_torque) {
        Term<S> alone = term;
        alone.factor = Factor::one;
        about(j, 2, basis_value(model, alone, context, ws));
      }
      break;
    default:
      break;
  }
  return r;
}

}  // namespace detail

/// LoadResponse of all effects at one pose, for exact_column(). Work grows with the effects, not with the
/// columns.
template <class S, std::size_t N, class Cap>
inline void load_response(const Model<S, N, Cap>& model, const Linearisation<S, N>& at,
                          const Context<S, N>& context, LoadResponse<S, N>& out) {
  out.any = false;
  if (!model.needs_loads()) return;
  const Frames<S, N>& frames = at.unloaded.frames;
  const std::array<S, 4>& edit = model.load_edit();
  const Matrix3<S>& flange = frames.rotation[N];
  out.com = frames.origin[N] + flange * Vector3<S>(context.payload_com_m[0] + edit[slot::com_x],
                                                   context.payload_com_m[1] + edit[slot::com_y],
                                                   context.payload_com_m[2] + edit[slot::com_z]);
  out.tool = frames.origin[N] + flange * model.tool_pose().position;
  out.weight = model.gravity() * (context.payload_kg + edit[slot::mass]);
  out.force = Vector3<S>(context.force_n[0], context.force_n[1], context.force_n[2]);
  out.to_load.setZero();
  for (auto& m : out.to_twist) m.setZero();
  for (std::size_t k = 0; k < model.effect_count(); ++k) {
    const Term<S>& effect = model.effect(k);
    // Effects at `point` move the measured point, not the pose that forward() gives.
    if (!needs_loads(effect.basis, effect.factor) || effect.place.body == body::point) continue;
    const Vector6<S> moved = screw(model, at, effect.place) * effect.coefficient;
    if (!(dot<S>(moved.template head<3>(), moved.template head<3>()) +
              dot<S>(moved.template tail<3>(), moved.template tail<3>()) >
          S(0)))
      continue;  // a coefficient that is still zero
    out.any = true;
    const detail::BasisResponse<S> r = detail::basis_response(model, effect, context, at.unloaded);
    out.to_load.noalias() += moved * r.load.transpose();
    // Frame f moves with the links 0 … f - 1.
    for (std::size_t i = 0; i < r.frame; ++i) out.to_twist[i].noalias() += moved * r.whole.transpose();
    for (std::size_t i = r.frame; i < r.distal; ++i) out.to_twist[i].noalias() += moved * r.part.transpose();
  }
}

/// Exact column of a term (M20), the derivative of forward() for its coefficient: 6 rows, m and rad per unit.
template <class S, std::size_t N, class Cap>
inline Vector6<S> exact_column(const Model<S, N, Cap>& model, const Linearisation<S, N>& at,
                               const LoadResponse<S, N>& response, const Term<S>& term,
                               const Context<S, N>& context) {
  Vector6<S> r = column(model, at, term, context);
  if (!is_constant(term) || !response.any || term.place.body == body::base) return r;
  const Place place = term.place;
  const Matrix3<S>& flange = at.unloaded.frames.rotation[N];
  Vector6<S> load = Vector6<S>::Zero();
  if (place.body == body::load) {
    if (place.slot == slot::mass) {
      load << model.gravity(), cross<S>(response.com, model.gravity());
    } else {
      load.template tail<3>() = cross<S>(flange.col(place.slot - slot::com_x), response.weight);
    }
  } else if (place.body == body::tool) {
    if (place.slot > slot::z) return r;
    load.template tail<3>() =
        cross<S>(flange * (model.nominal_tool().rotation.col(place.slot)), response.force);
  } else if (place.body >= 1 && place.body <= N) {
    const std::size_t i = place.body - 1U;
    const std::array<S, 6> none{};
    const Screw<S> s = detail::link_screw(model, at.unloaded.frames, at.unloaded.angle[i], i, place.slot,
                                          none, Vector3<S>(Vector3<S>::Zero()));
    Vector6<S> twist;
    twist << s.linear, s.angular;
    r.noalias() += response.to_twist[i] * twist;
    load.template tail<3>() = cross<S>(s.linear + cross<S>(s.angular, response.com), response.weight) +
                              cross<S>(s.linear + cross<S>(s.angular, response.tool), response.force);
  } else {
    return r;
  }
  r.noalias() += response.to_load * load;
  return r;
}

/// exact_column() of a single term.
template <class S, std::size_t N, class Cap>
inline Vector6<S> exact_column(const Model<S, N, Cap>& model, const Linearisation<S, N>& at,
                               const Term<S>& term, const Context<S, N>& context) {
  LoadResponse<S, N> response;
  load_response(model, at, context, response);
  return exact_column(model, at, response, term, context);
}

}  // namespace flexcomp

#endif
