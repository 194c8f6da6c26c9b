// SPDX-License-Identifier: Apache-2.0
/// \file
/// Joint readings whose tool has given orientations, as a cube of ISO 9283 or a tool that always points down.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <optional>
#include <vector>

#include "flexcomp/forward.hpp"
#include "identification/residuals.hpp"
#include "model/host_model.hpp"
#include "support/arms.hpp"

namespace oriented {

using namespace flexcomp;
using namespace flexcomp::host;

/// Inverse kinematics of the nominal arm by Newton from `start`; nothing where it does not end inside the limits.
inline std::optional<arms::Joints> reach(const Robot& robot, const HostModel& nominal,
                                         const arms::NominalJacobian& jacobian, arms::Joints q,
                                         const Pose<double>& wanted) {
  for (int k = 0; k < 30; ++k) {
    const Pose<double> now = nominal_forward(nominal, q);
    Vector6<double> e;
    e << wanted.position - now.position, rotation_vector(wanted.rotation * now.rotation.transpose());
    if (e.norm() < 1e-12) break;
    const Vector6<double> dq = jacobian(q).partialPivLu().solve(e);
    for (std::size_t i = 0; i < 6; ++i) q[i] += std::clamp(dq[static_cast<Eigen::Index>(i)], -0.3, 0.3);
  }
  const Pose<double> now = nominal_forward(nominal, q);
  bool good = (wanted.position - now.position).norm() < 1e-9 &&
              rotation_vector(wanted.rotation * now.rotation.transpose()).norm() < 1e-9;
  for (std::size_t i = 0; i < 6; ++i)
    good = good && q[i] > robot.nominal.limits[i].min_rad && q[i] < robot.nominal.limits[i].max_rad;
  if (!good) return {};
  return q;
}

/// Joint readings whose tool has these orientations in turn, at random positions of a cube of the workspace.
inline std::vector<arms::Joints> poses(const Robot& robot, const std::vector<Eigen::Matrix3d>& orientations,
                                       std::size_t count, arms::Random& random, double half_cube_m) {
  const auto nominal = prepare(TermSet(), robot, "nominal");
  const arms::NominalJacobian jacobian(robot.nominal);
  std::vector<arms::Joints> out;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  while (out.size() < count) {
    const arms::Joints start = random.pose(robot.nominal);
    Pose<double> wanted = nominal_forward(*nominal, start);
    if (out.empty()) middle = wanted.position;
    if ((wanted.position - middle).cwiseAbs().maxCoeff() > half_cube_m) {
      wanted.position =
          middle + half_cube_m * Eigen::Vector3d(random.around(1), random.around(1), random.around(1));
    }
    wanted.rotation = orientations[out.size() % orientations.size()];
    if (const auto q = reach(robot, *nominal, jacobian, start, wanted)) out.push_back(*q);
  }
  return out;
}

}  // namespace oriented
