// SPDX-License-Identifier: Apache-2.0
/// \file
/// The way back from an arm's joint readings: the nominal command that leads to them, and what loads do to the joints there
/// (docs/compensation.md, section 9). The true tool pose is forward().
#ifndef FLEXCOMP_ARM_STATE_HPP
#define FLEXCOMP_ARM_STATE_HPP

#include <array>
#include <cstddef>

#include "flexcomp/compensate.hpp"

namespace flexcomp {

/// Most compensations of uncorrect().
constexpr int most_uncorrections = 16;

/// Nominal command for joint readings (C21): the q_command (rad) for which compensate() gives q_reading (rad), by fixed
/// point; its slope is that of the correction, some 0.05 where the arm is regular. Accurate to 1e-10 rad (float 2e-6). False,
/// and q_command as far as it came, where the step refuses or limits what would lead there, or where it does not converge
/// (inside a singular region). For start, jogging, display and following error; work: at most 16 compensations.
template <class S, std::size_t N, class Cap>
inline bool uncorrect(const Model<S, N, Cap>& model, const std::array<S, N>& q_reading,
                      const Context<S, N>& context, const CompensationSettings<S>& settings,
                      std::array<S, N>& q_command) {
  const S tolerance = sizeof(S) > 4 ? S(1e-10) : S(2e-6F);
  q_command = q_reading;
  Compensated<S, N> out;
  for (int n = 0; n < most_uncorrections; ++n) {
    compensate(model, q_command, context, settings, out);
    if ((out.flags & step_flag::refused) != 0) return false;
    std::array<S, N> left;
    for (std::size_t i = 0; i < N; ++i) {
      left[i] = q_reading[i] - out.q[i];
      q_command[i] += left[i];
      // An iterate may pass a limit that the solution respects.
      clamp_to(q_command[i], model.lower(i), model.upper(i));
    }
    if (greatest_of(left) <= tolerance) return (out.flags & (step_flag::limited | step_flag::at_limit)) == 0;
  }
  return false;
}

/// What is left of a pose.
template <class S>
struct RemainingError {
  S position_m;                ///< 3-D distance
  S orientation_rad;           ///< sine of the angle, which is the angle to third order
  bool is_beyond_right_angle;  ///< of the angle: its sine decreases again
};

/// target_residual() by the kernels of the control cycle: the same to rounding and 1e-10 rad, in less flash beside them.
template <class S, std::size_t N, class Cap>
inline RemainingError<S> remaining_error(const Model<S, N, Cap>& model, const std::array<S, N>& q,
                                         const std::array<S, N>& q_command, const Context<S, N>& context) {
  const CompensationSettings<S> unused;
  detail::Correction<S, N, Cap> correction(model, context, unused);
  Vec3<S> shift, turn;
  const S trace = correction.rest(q_command, q, shift, turn);
  using std::sqrt;
  return {sqrt(dot(shift, shift)), sqrt(dot(turn, turn)), !(trace > S(1))};
}

/// What loads and effects do to the joints of an arm at given readings.
template <class S, std::size_t N>
struct JointLoads {
  std::array<S, N>
      torque_nm{};  ///< about each joint by payload and external force, links' weight left out (M11)
  std::array<S, N>
      deflection_rad{};  ///< by which all effects turn each joint beyond its reading and constant terms
};

/// Load torques and deflections at the readings q (rad). Work: one evaluation of the effects.
template <class S, std::size_t N, class Cap>
inline JointLoads<S, N> joint_loads(const Model<S, N, Cap>& model, const std::array<S, N>& q,
                                    const Context<S, N>& context) {
  JointLoads<S, N> out;
  std::array<SinCos<S>, N> angle;
  detail::sin_cos_all(q, model.shapes(), angle);
  detail::StaticLoad<S> load;
  detail::static_load(model, context, load);
  detail::LinkLoads<S, N> loads;
  detail::compute_loads(model, angle, load, loads);
  out.torque_nm = loads.torque;
  detail::load_deflection(model, context, q, angle, load, loads, out.deflection_rad);
  detail::add_other_deflections(model, q, context, out.deflection_rad);
  std::array<detail::Expansion<S>, N> own;
  detail::own_deflections(model, context, q, own);
  for (std::size_t i = 0; i < N; ++i) out.deflection_rad[i] += own[i].value;
  return out;
}

}  // namespace flexcomp

#endif
