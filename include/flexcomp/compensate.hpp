// SPDX-License-Identifier: Apache-2.0
/// \file
/// Inverse compensation (docs/compensation.md): the joint command that brings the flexible arm to the nominal
/// pose of the command.
///
/// One algorithm for every set (detail/correction.hpp): rigid inverse kinematics first, then the effects by fixed point.
/// Work is bounded on any input. Near a singularity the error that remains is in the orientation
/// (detail/damped_jacobian_solver.hpp).
///
/// The correction is continuous in the command but for what one step more or less of an iteration changes:
/// 1e-9 rad where the arm is regular. tests/core/compensation_test.cpp bounds its slope through the singularities.
#ifndef FLEXCOMP_COMPENSATE_HPP
#define FLEXCOMP_COMPENSATE_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "flexcomp/bounds.hpp"
#include "flexcomp/detail/correction.hpp"
#include "flexcomp/forward.hpp"

namespace flexcomp {

/// Result of a compensation.
template <class S, std::size_t N>
struct Compensated {
  std::array<S, N> q;                       ///< corrected joint command, rad
  StepStatus status = StepStatus::refused;  ///< summary of the flags
  std::uint16_t flags = 0;                  ///< what held it back, bits of step_flag
  S remaining_position_m = S(0);            ///< error of position that the last iterate shows
  S remaining_orientation_rad = S(0);       ///< the same of orientation
};

namespace detail {

/// True where no number of a context is a NaN or an infinity.
template <class S, std::size_t N>
inline bool is_finite_context(const Context<S, N>& c) {
  FiniteCheck<S> check;
  check.add(c.payload_kg);
  check.add(c.temperature_c);
  check.add(c.time_s);
  check.add(c.payload_com_m);
  check.add(c.force_n);
  check.add(c.direction);
  check.add(c.relative_speed);
  return check.passed();
}

/// compensate(), by a correction that keeps what its rate needs; q is the solution before the joint limits. False where it is
/// refused.
template <class S, std::size_t N, class Cap>
FLEXCOMP_ONCE bool compensate_by(Correction<S, N, Cap>& correction, const Model<S, N, Cap>& model,
                                 const std::array<S, N>& q_command, const Context<S, N>& context, S largest,
                                 Compensated<S, N>& out, std::array<S, N>& q) {
  for (std::size_t i = 0; i < N; ++i) out.q[i] = q_command[i];
  out.flags = step_flag::refused;
  out.status = StepStatus::refused;
  out.remaining_position_m = out.remaining_orientation_rad = S(0);
  for (std::size_t i = 0; i < N; ++i) {
    if (!(q_command[i] >= model.lower(i) && q_command[i] <= model.upper(i))) return false;
    q[i] = q_command[i];
  }
  // Checked here because a grid is constant outside its nodes, where a NaN would not show.
  if (!is_finite_context(context)) return false;
  correction.run(q);
  // Effects that grow beyond all bounds show as a NaN, an infinity or a turn that no arm makes; where they overflow on the way,
  // only in what they leave.
  S square = S(0);
  for (std::size_t i = 0; i < N; ++i) {
    const S change = q[i] - q_command[i];
    square += change * change;
  }
  constexpr S beyond_all_bounds = S(1e8);
  if (!(square < beyond_all_bounds && correction.position_left() < beyond_all_bounds &&
        correction.orientation_left() < beyond_all_bounds))
    return false;
  unsigned flags = correction.is_damped() ? step_flag::near_singular : 0U;
  if (!correction.has_converged()) flags |= step_flag::not_converged;
  // What limits cut off of the joints: at most as much turn of the tool, and as much at the arm's reach of its position.
  S cut = S(0);
  if (square > largest * largest) {
    std::array<S, N> change;
    for (std::size_t i = 0; i < N; ++i) change[i] = q[i] - q_command[i];
    if (scale_to_limit(change, largest)) {
      flags |= step_flag::limited;
      for (std::size_t i = 0; i < N; ++i) {
        const S x = q_command[i] + change[i];
        cut += q[i] < x ? x - q[i] : q[i] - x;
        q[i] = x;
      }
    }
  }
  for (std::size_t i = 0; i < N; ++i) {
    S x = q[i];
    if (clamp_to(x, model.lower(i), model.upper(i))) {
      flags |= step_flag::at_limit;
      cut += q[i] < x ? x - q[i] : q[i] - x;
    }
    out.q[i] = x;
  }
  out.flags = static_cast<std::uint16_t>(flags);
  out.status = summary(out.flags);
  out.remaining_position_m = correction.position_left() + cut * model.plan().reach();
  out.remaining_orientation_rad = correction.orientation_left() + cut;
  return true;
}

}  // namespace detail

/// Inverse compensation (C1): the joint command `out.q` (rad) at which the arm with all its terms has the
/// pose that the nominal arm has at q_command (rad).
///
/// The result is a pure function of the arguments; work is bounded on any input (section 10 of
/// docs/compensation.md). Refused (command passed through): a command that is not finite or lies beyond a
/// joint limit, a context that is not finite, and effects that grow beyond all bounds (a change of more than
/// 1e4 rad, an overflow). Otherwise the result is finite, within the joint limits, and no joint differs from
/// its command by more than settings.largest_correction_rad (C17).
template <class S, std::size_t N, class Cap>
inline void compensate(const Model<S, N, Cap>& model, const std::array<S, N>& q_command,
                       const Context<S, N>& context, const CompensationSettings<S>& settings,
                       Compensated<S, N>& out) {
  detail::Correction<S, N, Cap> correction(model, context, settings);
  std::array<S, N> q;
  detail::compensate_by(correction, model, q_command, context, settings.largest_correction_rad, out, q);
}

/// compensate() with the rate of the corrected command (C22): the derivative of out.q along q_rate_command (rad/s), context
/// and set standing still. Where anything holds the step back (out.flags) there is none: false, and q_rate is the command's.
template <class S, std::size_t N, class Cap>
inline bool compensate_rate(const Model<S, N, Cap>& model, const std::array<S, N>& q_command,
                            const std::array<S, N>& q_rate_command, const Context<S, N>& context,
                            const CompensationSettings<S>& settings, Compensated<S, N>& out,
                            std::array<S, N>& q_rate) {
  detail::CommandRate<S, N> rate{q_rate_command, {}, {}};
  detail::Correction<S, N, Cap> correction(model, context, settings, &rate);
  std::array<S, N> q;
  q_rate = q_rate_command;
  if (!detail::compensate_by(correction, model, q_command, context, settings.largest_correction_rad, out,
                             q) ||
      out.flags != 0) {
    return false;
  }
  if (correction.rate(q, q_rate)) return true;
  q_rate = q_rate_command;
  return false;
}

/// compensate() by value.
template <class S, std::size_t N, class Cap>
inline Compensated<S, N> compensate(const Model<S, N, Cap>& model, const std::array<S, N>& q_command,
                                    const Context<S, N>& context,
                                    const CompensationSettings<S>& settings = {}) {
  Compensated<S, N> out;
  compensate(model, q_command, context, settings, out);
  return out;
}

/// Remaining error of a pose: target minus what the forward model gives.
template <class S>
struct TargetResidual {
  S position_m = S(0);       ///< 3-D distance
  S orientation_rad = S(0);  ///< sine of the angle, which is the angle to third order
};

/// Remaining error at the command q (rad): forward model (M15) against the nominal pose at q_command (rad).
/// Work: two evaluations of the chain.
template <class S, std::size_t N, class Cap>
inline TargetResidual<S> target_residual(const Model<S, N, Cap>& model, const std::array<S, N>& q,
                                         const std::array<S, N>& q_command, const Context<S, N>& context) {
  const Pose<S> target = nominal_forward(model, q_command);
  Workspace<S, N> ws;
  const Pose<S> pose = forward(model, q, context, ws);
  const Vector3<S> p = target.position - pose.position;
  Vec3<S> r;
  detail::rotation_error(columns_of(target.rotation), columns_of(pose.rotation), r);
  using std::sqrt;
  return {sqrt(dot<S>(p, p)), sqrt(dot(r, r))};
}

}  // namespace flexcomp

#endif
