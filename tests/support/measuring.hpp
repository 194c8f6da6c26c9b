// SPDX-License-Identifier: Apache-2.0
// Simulated measurements of an assumed true TX60L, as the tests of the identification want them.
#ifndef FLEXCOMP_TESTS_SUPPORT_MEASURING_HPP
#define FLEXCOMP_TESTS_SUPPORT_MEASURING_HPP

#include <cstdint>
#include <random>
#include <vector>

#include "flexcomp/forward.hpp"
#include "identification/residuals.hpp"
#include "measurement/observation.hpp"
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
  Pose<double> f;
  Pose<double> e;
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

}  // namespace measuring

#endif
