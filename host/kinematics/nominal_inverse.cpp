// SPDX-License-Identifier: Apache-2.0
#include "kinematics/nominal_inverse.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "flexcomp/forward.hpp"
#include "flexcomp/identification.hpp"
#include "input_error.hpp"
#include "linalg/decompositions.hpp"
#include "quaternion.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

constexpr int most_steps = 200;
constexpr double reached = 1e-11;         // m and rad; rounding is 1e-15 of the reach
constexpr double longest_step_rad = 0.3;  // longer ones leave the branch

using JointVector = std::array<double, joint_count>;
/// Model of the nominal arm, with capacity for no terms.
using RigidModel = Model<double, joint_count, Capacity<1, 1, 6>>;

/// Shifts joint positions by full turns into the limits; false where that is impossible.
bool fit_into_limits(const NominalRobot<joint_count>& robot, JointVector& q) {
  for (std::size_t j = 0; j < joint_count; ++j) {
    const JointLimits& limits = robot.limits[j];
    if (q[j] > limits.max_rad) q[j] -= 2 * pi * std::ceil((q[j] - limits.max_rad) / (2 * pi));
    if (q[j] < limits.min_rad) q[j] += 2 * pi * std::ceil((limits.min_rad - q[j]) / (2 * pi));
    if (q[j] > limits.max_rad) return false;
  }
  return true;
}

}  // namespace

std::optional<JointVector> nominal_inverse(const NominalRobot<joint_count>& robot, const Pose<double>& target,
                                           const JointVector& seed_rad) {
  RigidModel model;
  model.begin(robot);
  model.finish();
  const auto context = default_context<double>(robot);
  JointVector q = seed_rad;
  for (int k = 0; k < most_steps; ++k) {
    Linearisation<double, joint_count> at;
    linearise(model, q, context, at);
    Vector6<double> error;
    error << target.position - at.pose.position, rotation_between(target.rotation, at.pose.rotation);
    if (error.head<3>().norm() < reached && error.tail<3>().norm() < reached) {
      if (!fit_into_limits(robot, q)) return {};
      return q;
    }
    Eigen::Matrix<double, 6, 6> jacobian;
    for (std::size_t j = 0; j < joint_count; ++j) {
      const Place theta{static_cast<std::uint8_t>(j + 1), slot::theta};
      jacobian.col(static_cast<Eigen::Index>(j)) = screw(model, at, theta);
    }
    Vector6<double> step = shortest_least_squares(jacobian, error);
    step *= std::min(1.0, longest_step_rad / std::max(step.cwiseAbs().maxCoeff(), 1e-300));
    if (!step.allFinite()) return {};
    for (std::size_t j = 0; j < joint_count; ++j) q[j] += step[static_cast<Eigen::Index>(j)];
  }
  return {};
}

std::vector<JointVector> nominal_inverses(const NominalRobot<joint_count>& robot,
                                          const Pose<double>& target) {
  // With 160 seeds nominal_inverse_test.cpp (six arms) misses no solution.
  constexpr std::uint64_t seeds = 160;
  constexpr double same_rad = 1e-6;
  constexpr std::array<std::uint64_t, joint_count> primes{2, 3, 5, 7, 11, 13};
  std::vector<JointVector> out;
  const auto add = [&out](const JointVector& q) {
    const bool found = std::ranges::any_of(out, [&q](const JointVector& other) {
      for (std::size_t j = 0; j < joint_count; ++j) {
        if (std::abs(q[j] - other[j]) > same_rad) return false;
      }
      return true;
    });
    if (!found) out.push_back(q);
  };
  for (std::uint64_t n = 1; n <= seeds; ++n) {
    JointVector seed{};
    for (std::size_t j = 0; j < joint_count; ++j) {
      // Halton sequence: quasi-random seeds within the limits.
      double fraction = 0;
      double digit = 1;
      for (std::uint64_t rest = n; rest > 0; rest /= primes[j]) {
        digit /= static_cast<double>(primes[j]);
        fraction += digit * static_cast<double>(rest % primes[j]);
      }
      const double least = std::max(robot.limits[j].min_rad, -pi);
      const double most = std::min(robot.limits[j].max_rad, pi);
      seed[j] = least + (most - least) * fraction;
    }
    const auto q = nominal_inverse(robot, target, seed);
    if (q) add(*q);
  }
  for (std::size_t j = 0; j < joint_count; ++j) {
    for (std::size_t k = 0, count = out.size(); k < count; ++k) {
      for (const double turn : {-2 * pi, 2 * pi}) {
        JointVector q = out[k];
        q[j] += turn;
        if (q[j] >= robot.limits[j].min_rad && q[j] <= robot.limits[j].max_rad) add(q);
      }
    }
  }
  return out;
}

std::vector<JointVector> joint_commands(const TargetsFile& targets, const Robot& robot) {
  std::vector<JointVector> commands;
  for (const Target& t : targets.rows) {
    if (!targets.poses) {
      commands.push_back(t.q_rad);
      continue;
    }
    const auto q = nominal_inverse(robot.nominal, {t.orientation.toRotationMatrix(), t.position_m}, t.q_rad);
    if (!q) {
      throw InputError(targets.path, t.line, "x_mm … qz",
                       "a pose that the nominal arm reaches from seed1_deg … seed6_deg within its limits",
                       "one that it does not reach");
    }
    commands.push_back(*q);
  }
  return commands;
}

}  // namespace flexcomp::host
