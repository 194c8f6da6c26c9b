// SPDX-License-Identifier: Apache-2.0
/// \file
/// Compensation of all other sets, with the two-pass forward model (docs/compensation.md, section 5).
#ifndef FLEXCOMP_DETAIL_GENERAL_PATH_HPP
#define FLEXCOMP_DETAIL_GENERAL_PATH_HPP

#include <array>
#include <cstddef>

#include "flexcomp/detail/damped_jacobian_solver.hpp"
#include "flexcomp/forward.hpp"

namespace flexcomp {
namespace detail {

/// Corrected command q (rad) by three corrections with the two-pass forward model (C16): Newton, Newton,
/// chord. `target` is the nominal pose in F0; on entry q is the command and the solver holds the nominal
/// Jacobian.
template <class S, std::size_t N, class Cap>
inline void correct_general(const Model<S, N, Cap>& model, const Pose<S>& target,
                            const Context<S, N>& context, const CompensationSettings<S>& settings,
                            const SingularRegion<S>& region, DampedJacobianSolver<S, N>& solver,
                            std::array<S, N>& q) {
  Workspace<S, N> ws;
  ws.q = q;
  for (std::size_t i = 0; i < N; ++i) ws.reading[i] = sin_cos(q[i]);
  const S largest = settings.largest_correction_rad;
  for (int k = 0; k < most_corrections; ++k) {
    const Pose<S> pose = evaluate(model, context, ws);
    Vec3<S> position = vec3<S>(target.position) - vec3<S>(pose.position);
    Vec3<S> orientation;
    rotation_error(columns_of(target.rotation), columns_of(pose.rotation), orientation);
    if (model.has_base()) {
      const Mat3<S> b = columns_of(model.base_pose().rotation);
      position = {dot(b.a, position), dot(b.b, position), dot(b.c, position)};
      orientation = {dot(b.a, orientation), dot(b.b, orientation), dot(b.c, orientation)};
    }
    if (k == 1) {
      // Near a singularity the first correction can turn the wrist by 20 mrad, which changes the Jacobian by
      // some percent: from here on the Jacobian of the deflected chain is used, which is close to that of the
      // solution.
      for (std::size_t i = 0; i < N; ++i)
        solver.joints()[i] = {vec3<S>(ws.frames.axis(i, 2)), vec3<S>(ws.frames.origin[i])};
      const Vec3<S> tool = vec3<S>(model.tool_pose().position);
      solver.set(vec3<S>(ws.frames.origin[N]) + combine(columns_of(ws.frames.rotation[N]), tool), region);
    }
    std::array<S, N> dq;
    solver.solve(position, orientation, largest, largest * allowed_turn<S>(k), dq);
    for (std::size_t i = 0; i < N; ++i) {
      ws.q[i] += dq[i];
      ws.reading[i] = rotate(ws.reading[i], dq[i]);
    }
  }
  q = ws.q;
}

}  // namespace detail
}  // namespace flexcomp

#endif
