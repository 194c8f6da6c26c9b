// SPDX-License-Identifier: Apache-2.0
// Simulated measurements of an assumed true TX60L, as the tests of the identification want them.
#pragma once

#include <cstdint>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "flexcomp/forward.hpp"
#include "identification/identify.hpp"
#include "measurement/observation.hpp"
#include "model/effects.hpp"
#include "model/host_model.hpp"
#include "support/arms.hpp"
#include "units.hpp"

namespace measuring {

using namespace flexcomp;
using namespace flexcomp::host;

inline constexpr double kPosition = 0.035e-3;
inline const double kOrientation = radians(0.007);

inline Robot tx60l() {
  Robot robot;
  robot.name = "staubli-tx60l";
  robot.nominal = arms::tx60l();
  robot.position_sigma_m = kPosition;
  robot.orientation_sigma_rad = kOrientation;
  return robot;
}

inline TermSet truth() {
  const auto t = arms::table1(arms::all()[0]);
  TermSet set;
  set.terms = t.terms;
  return set;
}

struct Measuring {
  double noise = 1;  // times N1
  bool pose = true;
  std::vector<double> payload_kg{1.108};
  Pose<double> f = {};
  Pose<double> e = {};
};

inline Observation measure(const HostModel& model, const arms::Joints& q, std::size_t k, const Measuring& how,
                           std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const auto vector = [&](double sigma) {
    return Eigen::Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  Observation row;
  row.q_rad = q;
  row.context = default_context<double>(model.robot());
  row.context.payload_kg = how.payload_kg[k % how.payload_kg.size()];
  Workspace<double, 6> ws;
  const Pose<double> pose = how.f * forward(model, q, row.context, ws) * how.e;
  row.p_m = pose.position + vector(how.noise * kPosition);
  row.R = rotation_of(vector(how.noise * kOrientation)) * pose.rotation;
  row.has_orientation = how.pose;
  row.whitening.setZero();
  row.whitening.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() / kPosition;
  if (how.pose) row.whitening.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() / kOrientation;
  row.line = k + 2;
  return row;
}

inline std::vector<Observation> measure(const Robot& robot, const TermSet& set, std::size_t count,
                                        std::uint64_t seed, const Measuring& how = {}) {
  const auto model = prepare(set, robot, "truth");
  std::mt19937_64 random(seed);
  arms::Random poses(seed * 7919 + 1);
  std::vector<Observation> rows;
  for (std::size_t k = 0; k < count; ++k)
    rows.push_back(measure(*model, poses.pose(robot.nominal), k, how, random));
  return rows;
}

/// Least squares without weights and bounds.
inline IdentifyOptions plain_least_squares() { return {.physical = false, .estimator = {.robust = false}}; }

/// Parameters by name, SI.
inline std::map<std::string, double> values_of(const TermSet& set, const Robot& robot) {
  std::map<std::string, double> values;
  for (const Parameter& p : parameters_of(set, robot.nominal)) values[p.name] = p.get(set);
  return values;
}

/// The truth with d1 + base z and theta1 + base rz lumped, as poses alone know them.
inline std::map<std::string, double> lumped_truth(const Robot& robot) {
  std::map<std::string, double> values = values_of(truth(), robot);
  values["link1.d_mm"] += values["base.z_mm"];
  values["link1.theta_deg"] += values["base.rz_deg"];
  return values;
}

}  // namespace measuring
