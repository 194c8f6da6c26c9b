/// \file
/// Identification columns (Chen et al. 2019, Eq. 7-9 and 17-23) read from the same terms as the forward
/// model: column = unit screw of the place, carried to the tool point, times the basis.
///
/// Two readings of one list. column() is the paper's H, first order: it leaves out that a geometric error
/// also shifts torques and levers. exact_column() adds that, and is the true derivative of forward(); the two
/// differ by (deflection / reach) of the column, see docs/model.md.
#ifndef FLEXCOMP_IDENTIFICATION_HPP
#define FLEXCOMP_IDENTIFICATION_HPP

#include <array>
#include <cstddef>

#include "flexcomp/forward.hpp"

namespace flexcomp {

/// Everything that columns need of one pose: the unloaded and the loaded chain, and the pose they lead to.
template <class S, std::size_t N = 6>
struct Linearisation {
  Workspace<S, N> unloaded;  ///< frames and load of the pass without effects
  Workspace<S, N> loaded;    ///< frames of the pass with them
  Pose<S> pose;              ///< forward(): Ftool in Fb
  Pose<S> base;              ///< B with its effects
  Vector3<S> tool_point;     ///< origin of Ftool in F0, loaded
  Matrix3<S> tool_rotation;  ///< Ftool in F0, loaded
};

/// Unit screw in F0: angular part, and linear part at the point it is asked for.
template <class S>
struct Screw {
  Vector3<S> linear;
  Vector3<S> angular;
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

/// Evaluates the model at joint readings q (rad) and keeps what columns need.
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
  detail::take_load(model, context, u);
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

/// Unit screw of a place in Fb at the origin of Ftool: how the pose moves per unit of the slot. m and rad;
/// rows position, then orientation as a rotation vector in Fb (R + dR = exp(w) R). Zero for `load`. For
/// `point` the translation of the measured point.
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

/// Column of H for a term: first order (the paper's). Zero for terms of the load.
template <class S, std::size_t N, class Cap>
inline Vector6<S> column(const Model<S, N, Cap>& model, const Linearisation<S, N>& at, const Term<S>& term,
                         const Context<S, N>& context) {
  return screw(model, at, term.place) * basis_value(model, term, context, at.unloaded);
}

namespace detail {

/// How the unloaded frames and the load change per unit of a constant slot.
template <class S, std::size_t N>
struct LoadChange {
  std::size_t first = N + 1;               ///< frames from this one on move as one body
  Vector3<S> linear = Vector3<S>::Zero();  ///< of the point at the origin of F0
  Vector3<S> angular = Vector3<S>::Zero();
  Load<S> load{Vector3<S>::Zero(), Vector3<S>::Zero()};

  Vector3<S> of_axis(std::size_t frame, const Vector3<S>& axis) const {
    return frame >= first ? cross<S>(angular, axis) : Vector3<S>(Vector3<S>::Zero());
  }
  Vector3<S> of_point(std::size_t frame, const Vector3<S>& point) const {
    return frame >= first ? Vector3<S>(linear + cross<S>(angular, point)) : Vector3<S>(Vector3<S>::Zero());
  }
};

template <class S, std::size_t N, class Cap>
inline LoadChange<S, N> load_change(const Model<S, N, Cap>& model, const Linearisation<S, N>& at, Place place,
                                    const Context<S, N>& context) {
  LoadChange<S, N> change;
  const Frames<S, N>& frames = at.unloaded.frames;
  const std::array<S, 4>& edit = model.load_edit();
  const Matrix3<S>& flange = frames.rotation[N];
  const Vector3<S> com = frames.origin[N] + flange * Vector3<S>(context.payload_com_m[0] + edit[slot::com_x],
                                                                context.payload_com_m[1] + edit[slot::com_y],
                                                                context.payload_com_m[2] + edit[slot::com_z]);
  const Vector3<S> weight = model.gravity() * (context.payload_kg + edit[slot::mass]);
  const Vector3<S> force(context.force_n[0], context.force_n[1], context.force_n[2]);
  const Vector3<S> tool = frames.origin[N] + flange * model.tool_pose().position;
  if (place.body == body::load) {
    if (place.slot == slot::mass) {
      change.load = {model.gravity(), cross<S>(com, model.gravity())};
    } else {
      change.load.moment = cross<S>(flange.col(place.slot - slot::com_x), weight);
    }
  } else if (place.body == body::tool) {
    if (place.slot <= slot::z) {
      change.load.moment = cross<S>(flange * (model.nominal_tool().rotation.col(place.slot)), force);
    }
  } else if (place.body >= 1 && place.body <= N) {
    const std::size_t i = place.body - 1U;
    const std::array<S, 6> none{};
    const Screw<S> s =
        link_screw(model, frames, at.unloaded.angle[i], i, place.slot, none, Vector3<S>(Vector3<S>::Zero()));
    change.first = i + 1;
    change.linear = s.linear;
    change.angular = s.angular;
    change.load.moment =
        cross<S>(change.of_point(N, com), weight) + cross<S>(change.of_point(N, tool), force);
  }
  return change;
}

/// Change of a moment about a direction through a point.
template <class S>
inline S moment_change(const Load<S>& load, const Load<S>& change, const Vector3<S>& direction,
                       const Vector3<S>& d_direction, const Vector3<S>& point, const Vector3<S>& d_point) {
  return dot<S>(d_direction, load.moment - cross<S>(point, load.force)) +
         dot<S>(direction, change.moment - cross<S>(d_point, load.force) - cross<S>(point, change.force));
}

/// Change of basis_value() per unit of the slot behind `change`.
template <class S, std::size_t N, class Cap>
inline S basis_change(const Model<S, N, Cap>& model, const Term<S>& term, const Context<S, N>& context,
                      const Workspace<S, N>& ws, const LoadChange<S, N>& change) {
  const std::size_t j = term.joint;
  const Frames<S, N>& f = ws.frames;
  const auto about = [&](std::size_t frame, int axis) {
    return moment_change<S>(ws.load, change.load, f.axis(frame, axis),
                            change.of_axis(frame, f.axis(frame, axis)), f.origin[frame],
                            change.of_point(frame, f.origin[frame]));
  };
  switch (term.basis) {
    case Basis::load_torque:
      return about(j, 2);
    case Basis::load_torque_cubed: {
      const S tau = moment_about<S>(ws.load, f.axis(j, 2), f.origin[j]);
      return S(3) * tau * tau * about(j, 2);
    }
    case Basis::load_moment_x:
      return about(j + 1, 0);
    case Basis::load_moment_y:
      return about(j + 1, 1);
    case Basis::base_moment_x:
    case Basis::base_moment_y: {
      const Vector3<S> axis = term.basis == Basis::base_moment_x ? Vector3<S>(Vector3<S>::UnitX())
                                                                 : Vector3<S>(Vector3<S>::UnitY());
      const Vector3<S> zero = Vector3<S>::Zero();
      return moment_change<S>(ws.load, change.load, axis, zero, Vector3<S>(S(0), S(0), term.argument), zero);
    }
    case Basis::link_weight: {
      std::size_t far = N - 1;
      while (far > j + 1 && S(static_cast<float>(far)) > term.argument) --far;
      const Vector3<S> z = f.axis(j, 2);
      const Vector3<S> dz = change.of_axis(j, z);
      const Vector3<S> arm = f.origin[far] - f.origin[j];
      const Vector3<S> d_arm = change.of_point(far, f.origin[far]) - change.of_point(j, f.origin[j]);
      const S along = dot<S>(z, arm);
      const S square = dot<S>(arm, arm) - along * along;
      const S g2 = dot<S>(model.gravity(), model.gravity());
      if (!(square > S(1e-6)) || !(g2 > S(0))) return S(0);
      const S d_along = dot<S>(dz, arm) + dot<S>(z, d_arm);
      const S d_square = S(2) * (dot<S>(arm, d_arm) - along * d_along);
      const S top = dot<S>(z, cross<S>(arm, model.gravity()));
      const S d_top =
          dot<S>(dz, cross<S>(arm, model.gravity())) + dot<S>(z, cross<S>(d_arm, model.gravity()));
      using std::sqrt;
      return (d_top - top * d_square / (S(2) * square)) / sqrt(square * g2);
    }
    case Basis::curve:
      if (term.factor == Factor::load_torque) {
        Term<S> alone = term;
        alone.factor = Factor::one;
        return basis_value(model, alone, context, ws) * about(j, 2);
      }
      return S(0);
    default:
      return S(0);
  }
}

}  // namespace detail

/// Derivative of forward() for a term's coefficient: column() plus what the constant slot does to torques,
/// levers and moments of the model's own effects.
template <class S, std::size_t N, class Cap>
inline Vector6<S> exact_column(const Model<S, N, Cap>& model, const Linearisation<S, N>& at,
                               const Term<S>& term, const Context<S, N>& context) {
  Vector6<S> r = column(model, at, term, context);
  if (!(is_constant(term) && model.needs_loads()) || term.place.body == body::base) return r;
  const detail::LoadChange<S, N> change = detail::load_change(model, at, term.place, context);
  for (std::size_t k = 0; k < model.effect_count(); ++k) {
    const Term<S>& effect = model.effect(k);
    // Effects at `point` move the measured point, not the pose that forward() gives.
    if (!needs_loads(effect.basis, effect.factor) || effect.place.body == body::point) continue;
    const S d = detail::basis_change(model, effect, context, at.unloaded, change);
    r += screw(model, at, effect.place) * (effect.coefficient * d);
  }
  return r;
}

}  // namespace flexcomp

#endif
