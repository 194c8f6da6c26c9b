// SPDX-License-Identifier: Apache-2.0
/// \file
/// Inverse compensation (docs/compensation.md): the joint command that brings the flexible arm to the nominal
/// pose of the command.
///
/// A set whose effects all turn joints (Model::has_only_joint_deflections(); every set of the paper's model)
/// takes the joint-only path: rigid inverse kinematics first, then the deflections. All other sets take the
/// general path, three corrections with the forward model. Work is bounded on any input. Near a singularity
/// the error that remains is in the orientation (detail/damped_jacobian_solver.hpp).
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
#include "flexcomp/detail/damped_jacobian_solver.hpp"
#include "flexcomp/detail/general_path.hpp"
#include "flexcomp/detail/joint_only_path.hpp"
#include "flexcomp/detail/rigid_chain.hpp"
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

}  // namespace detail

/// Inverse compensation (C1): the joint command `out.q` (rad) at which the arm with all its terms has the
/// pose that the nominal arm has at q_command (rad).
///
/// The result is a pure function of the arguments; work is bounded on any input (section 9 of
/// docs/compensation.md). Refused (command passed through): a command that is not finite or lies beyond a
/// joint limit, a context that is not finite, and effects that grow beyond all bounds (a change of more than
/// 1e4 rad, an overflow). Otherwise the result is finite, within the joint limits, and no joint differs from
/// its command by more than settings.largest_correction_rad (C17).
template <class S, std::size_t N, class Cap>
inline void compensate(const Model<S, N, Cap>& model, const std::array<S, N>& q_command,
                       const Context<S, N>& context, const CompensationSettings<S>& settings,
                       Compensated<S, N>& out) {
  const auto refuse = [&out, &q_command] {
    out.q = q_command;
    out.status = StepStatus::refused;
  };
  for (std::size_t i = 0; i < N; ++i) {
    if (!(q_command[i] >= model.lower(i) && q_command[i] <= model.upper(i))) return refuse();
  }
  // Checked here because a grid is constant outside its nodes, where a NaN would not show.
  if (!detail::is_finite_context(context)) return refuse();
  const S largest = settings.largest_correction_rad;
  std::array<SinCos<S>, N> angle;
  detail::sin_cos_all(q_command, model.nominals(), angle);
  detail::DampedJacobianSolver<S, N> solver;
  detail::FlangeTarget<S> target;
  detail::rigid_pass(model.nominals(), angle, solver.joints(), target.flange);
  detail::flange_point(target.flange, vec3<S>(model.nominal_tool().position), target.tool_point);
  const SingularRegion<S> region = singular_region(model.tool_motion(), settings);
  solver.set(target.tool_point, region);
  std::array<S, N> q;
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) q[i] = q_command[i];
  if (model.has_only_joint_deflections()) {
    detail::correct_joint_deflections(model, target, context, angle, solver, settings, region, q);
  } else {
    const Pose<S> target = nominal_forward(model, q_command);
    detail::correct_general(model, target, context, settings, region, solver, q);
  }
  // Effects that grow beyond all bounds show as a NaN, an infinity or a turn that no arm makes.
  S square = S(0);
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) {
    const S change = q[i] - q_command[i];
    square += change * change;
  }
  if (!(square < S(1e8))) return refuse();
  out.status = solver.is_damped() ? StepStatus::near_singular : StepStatus::ok;
  if (square > largest * largest) {
    std::array<S, N> change;
    for (std::size_t i = 0; i < N; ++i) change[i] = q[i] - q_command[i];
    if (scale_to_limit(change, largest)) {
      out.status = StepStatus::limited;
      for (std::size_t i = 0; i < N; ++i) q[i] = q_command[i] + change[i];
    }
  }
  for (std::size_t i = 0; i < N; ++i) {
    S x = q[i];
    if (clamp_to(x, model.lower(i), model.upper(i))) out.status = StepStatus::at_limit;
    out.q[i] = x;
  }
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
