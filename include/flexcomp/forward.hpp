// SPDX-License-Identifier: Apache-2.0
/// \file
/// The rigid-flexible forward model in two passes (docs/model.md, M15; Chen et al. 2019, Eq. 1 and 10-22).
///
/// Torques, levers and moments are computed once, in the chain with the constant geometric and tool terms
/// only; then all effects are added and the chain is evaluated again. Host and controller keep this order to
/// the last bit.
#ifndef FLEXCOMP_FORWARD_HPP
#define FLEXCOMP_FORWARD_HPP

#include <array>
#include <cmath>
#include <cstddef>

#include "flexcomp/detail/basis.hpp"
#include "flexcomp/linear.hpp"
#include "flexcomp/model.hpp"
#include "flexcomp/robot.hpp"
#include "flexcomp/term.hpp"
#include "flexcomp/trigonometry.hpp"

namespace flexcomp {

/// Link frames in F0: index 0 is F0, index i the frame after link i. Joint i (from 0) turns about z of frame
/// i.
template <class S, std::size_t N>
struct Frames {
  std::array<Matrix3<S>, N + 1> rotation;  ///< columns: axes
  std::array<Vector3<S>, N + 1> origin;    ///< m

  /// Axis 0, 1, 2 (x, y, z) of a frame.
  Vector3<S> axis(std::size_t frame, int column) const { return rotation[frame].col(column); }
};

/// Load (M9) as one force and one moment about the origin of F0.
template <class S>
struct Load {
  Vector3<S> force;   ///< N
  Vector3<S> moment;  ///< N·m
};

/// Sum of all effects at each slot (M5), on top of the constant values; m and rad.
template <class S, std::size_t N>
struct Slots {
  std::array<std::array<S, 6>, N> link;  ///< by link and slot
  std::array<S, 6> base;                 ///< by slot
  std::array<S, 6> tool;                 ///< by slot
  std::array<S, 3> point;                ///< by slot

  /// Sets all to 0. A temporary of this size does not fit on a controller's stack.
  void clear() {
    for (std::array<S, 6>& values : link) values.fill(S(0));
    base.fill(S(0));
    tool.fill(S(0));
    point.fill(S(0));
  }
};

/// Memory of one evaluation, and its intermediate results. The caller sets nothing in it.
template <class S, std::size_t N = 6>
struct Workspace {
  std::array<S, N> q;                     ///< joint readings, rad
  std::array<SinCos<S>, N> reading;       ///< of q
  std::array<SinCos<S>, N> angle;         ///< of q + constant offset
  std::array<SinCos<S>, N> deflected;     ///< of q + constant offset + effects
  Frames<S, N> frames;                    ///< of the last pass, in F0
  Load<S> load;                           ///< of the unloaded pass, in F0
  Slots<S, N> slots;                      ///< of all effects
  Vector3<S> point = Vector3<S>::Zero();  ///< where effects move the measured point, in Ftool, m
};

namespace detail {

/// Next frame of the chain by one link (M2). Rot(z), Rot(y) and Rot(x) each mix two columns only, so a link
/// costs 30 multiplications instead of 45.
template <class S>
inline void advance(const Matrix3<S>& from, const Vector3<S>& origin, const SinCos<S>& theta, const S& d,
                    const S& a, const SinCos<S>& alpha, const SinCos<S>* beta, const SinCos<S>* gamma,
                    Matrix3<S>& to, Vector3<S>& to_origin) {
  Vector3<S> x = from.col(0) * theta.c + from.col(1) * theta.s;
  const Vector3<S> y = from.col(1) * theta.c - from.col(0) * theta.s;
  Vector3<S> z = from.col(2);
  to_origin = origin + z * d + x * a;
  if (gamma != nullptr) {
    const Vector3<S> turned = x * gamma->c - z * gamma->s;
    z = x * gamma->s + z * gamma->c;
    x = turned;
  }
  to.col(1) = y * alpha.c + z * alpha.s;
  z = z * alpha.c - y * alpha.s;
  if (beta != nullptr) {
    to.col(0) = x * beta->c - z * beta->s;
    to.col(2) = x * beta->s + z * beta->c;
  } else {
    to.col(0) = x;
    to.col(2) = z;
  }
}

/// Chain with constant terms only, C_0 of (M15); joint angles in ws.angle.
template <class S, std::size_t N, class Cap>
inline void unloaded_pass(const Model<S, N, Cap>& model, Workspace<S, N>& ws) {
  ws.frames.rotation[0].setIdentity();
  ws.frames.origin[0].setZero();
  for (std::size_t i = 0; i < N; ++i) {
    const LinkShape<S>& link = model.shape(i);
    advance<S>(ws.frames.rotation[i], ws.frames.origin[i], ws.angle[i], link.d, link.a, link.alpha,
               link.has_beta ? &link.beta : nullptr, nullptr, ws.frames.rotation[i + 1],
               ws.frames.origin[i + 1]);
  }
}

/// Chain with all effects (M15) in ws.slots.
template <class S, std::size_t N, class Cap>
inline void loaded_pass(const Model<S, N, Cap>& model, Workspace<S, N>& ws) {
  ws.frames.rotation[0].setIdentity();
  ws.frames.origin[0].setZero();
  for (std::size_t i = 0; i < N; ++i) {
    const LinkShape<S>& link = model.shape(i);
    const unsigned moved = model.link_moves(i);
    const std::array<S, 6>& delta = ws.slots.link[i];
    ws.deflected[i] =
        (moved & (1U << slot::theta)) != 0 ? rotate(ws.angle[i], delta[slot::theta]) : ws.angle[i];
    if ((moved & ~(1U << slot::theta)) == 0) {
      advance<S>(ws.frames.rotation[i], ws.frames.origin[i], ws.deflected[i], link.d, link.a, link.alpha,
                 link.has_beta ? &link.beta : nullptr, nullptr, ws.frames.rotation[i + 1],
                 ws.frames.origin[i + 1]);
    } else {
      const SinCos<S> alpha = rotate(link.alpha, delta[slot::alpha]);
      const SinCos<S> beta = rotate(link.beta, delta[slot::beta]);
      const SinCos<S> gamma = rotate(SinCos<S>{S(0), S(1)}, delta[slot::gamma]);
      advance<S>(ws.frames.rotation[i], ws.frames.origin[i], ws.deflected[i], link.d + delta[slot::d],
                 link.a + delta[slot::a], alpha, link.has_beta ? &beta : nullptr,
                 (moved & (1U << slot::gamma)) != 0 ? &gamma : nullptr, ws.frames.rotation[i + 1],
                 ws.frames.origin[i + 1]);
    }
  }
}

/// Load (M8, M9) of payload and external force in the frames of ws.
template <class S, std::size_t N, class Cap>
inline void compute_load(const Model<S, N, Cap>& model, const Context<S, N>& context, Workspace<S, N>& ws) {
  const std::array<S, 4>& edit = model.load_edit();
  const Vector3<S> com(context.payload_com_m[0] + edit[slot::com_x],
                       context.payload_com_m[1] + edit[slot::com_y],
                       context.payload_com_m[2] + edit[slot::com_z]);
  const Vector3<S> weight = model.gravity() * (context.payload_kg + edit[slot::mass]);
  const Matrix3<S>& flange = ws.frames.rotation[N];
  const Vector3<S> at =
      ws.frames.origin[N] + flange.col(0) * com.x() + flange.col(1) * com.y() + flange.col(2) * com.z();
  const Vector3<S> force(context.force_n[0], context.force_n[1], context.force_n[2]);
  const Vector3<S>& tool = model.tool_pose().position;
  const Vector3<S> tool_at =
      ws.frames.origin[N] + flange.col(0) * tool.x() + flange.col(1) * tool.y() + flange.col(2) * tool.z();
  ws.load.force = weight + force;
  ws.load.moment = cross<S>(at, weight) + cross<S>(tool_at, force);
}

/// Load moment (M10) about a direction through a point, N·m.
template <class S>
inline S moment_about(const Load<S>& load, const Vector3<S>& direction, const Vector3<S>& point) {
  return dot<S>(direction, load.moment - cross<S>(point, load.force));
}

/// Link-weight lever (M13) from a joint to its distal joint: z · ((distal - p) × g_hat) / ‖part of (distal -
/// p) perpendicular to z‖; on the TX60L exactly sin q2 and sin(q2 + q3). Zero where the perpendicular part is
/// under 1 mm.
template <class S, std::size_t N>
inline S link_weight_lever(const Frames<S, N>& frames, const Vector3<S>& gravity, std::size_t joint,
                           std::size_t distal) {
  const Vector3<S> z = frames.axis(joint, 2);
  const Vector3<S> arm = frames.origin[distal] - frames.origin[joint];
  const Vector3<S> across = arm - z * dot<S>(z, arm);
  const S square = dot<S>(across, across);
  const S g2 = dot<S>(gravity, gravity);
  if (!(square > S(1e-6)) || !(g2 > S(0))) return S(0);
  using std::sqrt;  // dual numbers bring their own
  return dot<S>(z, cross<S>(arm, gravity)) / sqrt(square * g2);
}

}  // namespace detail

/// Basis φ(q, context) of a term (M5) that a model accepts, at the pose in ws. ws.frames and ws.load are
/// those of the unloaded pass where needs_loads(basis, factor) holds.
template <class S, std::size_t N, class Cap>
inline S basis_value(const Model<S, N, Cap>& model, const Term<S>& term, const Context<S, N>& context,
                     const Workspace<S, N>& ws) {
  const std::size_t j = term.joint;
  const auto torque = [&ws, j]() {
    return detail::moment_about<S>(ws.load, ws.frames.axis(j, 2), ws.frames.origin[j]);
  };
  switch (term.basis) {
    case Basis::load_torque:
      return torque();
    case Basis::load_torque_cubed: {
      const S tau = torque();
      return tau * tau * tau;
    }
    case Basis::link_weight:
      return detail::link_weight_lever<S, N>(ws.frames, model.gravity(), j, term.distal_joint);
    case Basis::load_moment_x:
      return detail::moment_about<S>(ws.load, ws.frames.axis(j + 1, 0), ws.frames.origin[j + 1]);
    case Basis::load_moment_y:
      return detail::moment_about<S>(ws.load, ws.frames.axis(j + 1, 1), ws.frames.origin[j + 1]);
    case Basis::base_moment_x:
      return detail::moment_about<S>(ws.load, Vector3<S>::UnitX(), Vector3<S>(S(0), S(0), term.argument));
    case Basis::base_moment_y:
      return detail::moment_about<S>(ws.load, Vector3<S>::UnitY(), Vector3<S>(S(0), S(0), term.argument));
    default: {
      detail::Wave<S> wave;
      const S value = detail::plain_basis_value(model, term, context, ws.q, wave);
      return term.basis == Basis::curve && term.factor == Factor::load_torque ? value * torque() : value;
    }
  }
}

namespace detail {

/// Forward model (M15) for the readings in ws.q and ws.reading; leaves the loaded frames in ws.
template <class S, std::size_t N, class Cap>
inline Pose<S> evaluate(const Model<S, N, Cap>& model, const Context<S, N>& context, Workspace<S, N>& ws) {
  for (std::size_t i = 0; i < N; ++i) ws.angle[i] = compose(ws.reading[i], model.shape(i).offset);
  if (model.needs_loads()) {
    unloaded_pass(model, ws);
    compute_load(model, context, ws);
  }
  ws.slots.clear();
  for (std::size_t k = 0; k < model.effect_count(); ++k) {
    const Term<S>& term = model.effect(k);
    const S value = term.coefficient * basis_value(model, term, context, ws);
    const Place p = term.place;
    if (p.body == body::base) {
      ws.slots.base[p.slot] += value;
    } else if (p.body == body::tool) {
      ws.slots.tool[p.slot] += value;
    } else if (p.body == body::point) {
      ws.slots.point[p.slot] += value;
    } else {
      ws.slots.link[p.body - 1U][p.slot] += value;
    }
  }
  loaded_pass(model, ws);
  ws.point = Vector3<S>(ws.slots.point[0], ws.slots.point[1], ws.slots.point[2]);
  Pose<S> pose{ws.frames.rotation[N], ws.frames.origin[N]};
  if (model.tool_moves()) {
    std::array<S, 6> tool = model.tool();
    for (std::size_t k = 0; k < 6; ++k) tool[k] += ws.slots.tool[k];
    pose = pose * (model.nominal_tool() * small_pose(tool));
  } else {
    pose = pose * model.tool_pose();
  }
  if (model.base_moves()) {
    std::array<S, 6> base = model.base();
    for (std::size_t k = 0; k < 6; ++k) base[k] += ws.slots.base[k];
    pose = small_pose(base) * pose;
  } else if (model.has_base()) {
    pose = model.base_pose() * pose;
  }
  return pose;
}

/// Nominal chain for given sines and cosines of the readings.
template <class S, std::size_t N, class Cap>
inline void nominal_pass(const Model<S, N, Cap>& model, const std::array<SinCos<S>, N>& reading,
                         Frames<S, N>& frames) {
  frames.rotation[0].setIdentity();
  frames.origin[0].setZero();
  for (std::size_t i = 0; i < N; ++i) {
    const LinkShape<S>& link = model.nominal(i);
    advance<S>(frames.rotation[i], frames.origin[i], compose(reading[i], link.offset), link.d, link.a,
               link.alpha, link.has_beta ? &link.beta : nullptr, nullptr, frames.rotation[i + 1],
               frames.origin[i + 1]);
  }
}

}  // namespace detail

/// Forward model (M1, M15): pose of Ftool in Fb with all terms, for joint readings q (rad). Includes B, but
/// not the frames F and E of a measurement; ws.point is where effects move the measured point in Ftool. Work:
/// at most two chain passes and one basis per effect.
template <class S, std::size_t N, class Cap>
inline Pose<S> forward(const Model<S, N, Cap>& model, const std::array<S, N>& q_rad,
                       const Context<S, N>& context, Workspace<S, N>& ws) {
  ws.q = q_rad;
  for (std::size_t i = 0; i < N; ++i) ws.reading[i] = sin_cos(q_rad[i]);
  return detail::evaluate(model, context, ws);
}

/// Nominal forward kinematics (M2): pose of Ftool in F0 for joint readings q (rad).
template <class S, std::size_t N, class Cap>
inline Pose<S> nominal_forward(const Model<S, N, Cap>& model, const std::array<S, N>& q_rad) {
  std::array<SinCos<S>, N> reading;
  for (std::size_t i = 0; i < N; ++i) reading[i] = sin_cos(q_rad[i]);
  Frames<S, N> frames;
  detail::nominal_pass(model, reading, frames);
  return Pose<S>{frames.rotation[N], frames.origin[N]} * model.nominal_tool();
}

}  // namespace flexcomp

#endif
