// SPDX-License-Identifier: Apache-2.0
// Identification against the paper's figures, and against what no data can know.
#include "identification/identify.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <map>
#include <random>
#include <string>

#include "flexcomp/forward.hpp"
#include "flexcomp/identification.hpp"
#include "identification/validate.hpp"
#include "support/arms.hpp"
#include "support/measuring.hpp"
#include "support/oriented_poses.hpp"
#include "support/text_file.hpp"

namespace {

using namespace measuring;

ErrorStatistics held_out(const Robot& robot, const Calibration& c, const std::vector<Observation>& rows) {
  return validate(robot, c, rows, "held out").after;
}

TEST(Identify, NoiseFreePosesGiveThePapersErrorsBack) {
  const Robot robot = tx60l();
  Measuring how{.noise = 0};
  const Identification r =
      identify(robot, measure(robot, truth(), 40, 1, how), "data", plain_least_squares());
  EXPECT_EQ(r.parameters, 39U);
  EXPECT_EQ(r.identifiable, 36U);
  EXPECT_TRUE(r.identifiability.missing.empty());
  EXPECT_TRUE(r.fit.converged);
  EXPECT_LT(r.after.max_m, 1e-9);
  // Every number itself, with d1 + base z and theta1 + base rz lumped as the names say.
  const std::map<std::string, double> true_value = lumped_truth(robot);
  const std::map<std::string, double> found = values_of(r.calibration.terms, robot);
  EXPECT_EQ(found.size(), 36U);
  for (const auto& [name, value] : found) {
    const double want = true_value.at(name);
    // Lumping is exact to first order only: base tilt times base height.
    EXPECT_NEAR(value, want, 2e-3 * std::abs(want) + 1e-9) << name;
  }
}

// docs/model.md, M50: 14 random poses, N1, whitened least squares: mean score of the 36 is 0.82 +- 0.01.
TEST(Identify, ScoreOf14RandomPosesIsThePapers) {
  const Robot robot = tx60l();
  const std::map<std::string, double> true_value = lumped_truth(robot);
  double sum = 0;
  int count = 0;
  for (std::uint64_t set = 0; set < 40; ++set) {
    const Identification r =
        identify(robot, measure(robot, truth(), 14, 100 + set), "data", plain_least_squares());
    ASSERT_EQ(r.identifiable, 36U);
    for (const auto& [name, value] : values_of(r.calibration.terms, robot)) {
      const double want = true_value.at(name);
      sum += std::max(0.0, 1 - std::abs(value - want) / std::abs(want)) / 36;
    }
    ++count;
  }
  RecordProperty("score", std::to_string(sum / count));
  std::printf("mean score over %d sets: %.4f (the paper: 0.8218)\n", count, sum / count);
  EXPECT_NEAR(sum / count, 0.82, 0.02);
}

TEST(Identify, EveryStepLengthOfThePaperConverges) {
  const Robot robot = tx60l();
  const auto rows = measure(robot, truth(), 20, 3);
  double cost = 0;
  for (const double upsilon : {4.0, 10.0, 100.0}) {
    IdentifyOptions o = plain_least_squares();
    o.estimator.upsilon = upsilon;
    const Identification r = identify(robot, rows, "data", o);
    EXPECT_TRUE(r.fit.converged) << upsilon;
    EXPECT_LT(r.fit.newton_decrement, 1e-8);
    if (cost > 0) {
      EXPECT_NEAR(r.fit.chi2, cost, 1e-6 * cost);
    }
    cost = r.fit.chi2;
  }
}

// Standardised errors of the parameters must look like a standard normal: the uncertainty is right.
TEST(Identify, UncertaintyIsRight) {
  const Robot robot = tx60l();
  const std::map<std::string, double> true_value = lumped_truth(robot);
  Measuring how{.payload_kg = {0, 3}};
  int inside = 0;
  int all = 0;
  double squares = 0;
  for (std::uint64_t set = 0; set < 30; ++set) {
    const Identification r = identify(robot, measure(robot, truth(), 40, 500 + set, how), "data", {});
    for (const Parameter& p : parameters_of(r.calibration.terms, robot.nominal)) {
      const double z =
          (p.get(r.calibration.terms) - true_value.at(p.name)) / r.calibration.sigma[p.terms.front()];
      inside += std::abs(z) < 1.96 ? 1 : 0;
      squares += z * z;
      ++all;
    }
  }
  const double coverage = static_cast<double>(inside) / all;
  std::printf("95 %% intervals cover %.3f of %d; mean square of standardised errors %.3f\n", coverage, all,
              squares / all);
  EXPECT_NEAR(coverage, 0.95, 0.025);
  EXPECT_NEAR(squares / all, 1.0, 0.15);
}

TEST(Identify, OutliersLoseTheirPullAndAreNamed) {
  const Robot robot = tx60l();
  auto rows = measure(robot, truth(), 60, 11);
  const auto others = measure(robot, truth(), 100, 12);
  const double clean = held_out(robot, identify(robot, rows, "data", {}).calibration, others).mean_m;
  rows[7].p_m.x() += 5e-3;
  rows[31].p_m.z() -= 2e-3;
  rows[44].R = rotation_of({0.02, 0, 0}) * rows[44].R;
  const Identification r = identify(robot, rows, "data", {});
  for (const std::size_t k : {7U, 31U, 44U}) {
    EXPECT_TRUE(std::ranges::count(r.outliers, k)) << k;
  }
  EXPECT_LE(r.outliers.size(), 5U);
  EXPECT_LT(held_out(robot, r.calibration, others).mean_m, 1.1 * clean);
  EXPECT_GT(held_out(robot, identify(robot, rows, "data", plain_least_squares()).calibration, others).mean_m,
            1.5 * clean);
}

TEST(Identify, FramesOfAnySizeAreFound) {
  const Robot robot = tx60l();
  Measuring how;
  how.f.position = {2.4, -1.1, 0.7};
  how.f.rotation = rotation_of({0.4, -1.9, 0.8});
  how.e.position = {0.12, -0.25, 0.31};
  how.e.rotation = rotation_of({-1.2, 0.3, 2.0});
  for (const bool pose : {true, false}) {
    how.pose = pose;
    const auto rows = measure(robot, truth(), 60, 21, how);
    const Identification r = identify(robot, rows, "data", {});
    EXPECT_EQ(r.frame_parameters, pose ? 12U : 9U);
    EXPECT_EQ(r.parameters, 33U);
    ASSERT_TRUE(r.calibration.frames);
    EXPECT_NEAR(r.fit.chi2_per_dof(), 1, 0.3);
    EXPECT_TRUE(r.identifiability.missing.empty());
    EXPECT_NEAR((r.calibration.f().position - how.f.position).norm(), 0, 3e-3);
    EXPECT_LT(held_out(robot, r.calibration, measure(robot, truth(), 50, 22, how)).mean_m, 0.12e-3);
    EXPECT_GT(r.before.nominal_frames.mean_m, 1);
    EXPECT_LT(r.before.fitted_frames->mean_m, 5e-3);
  }
}

TEST(Identify, TooFewPosesAreAnsweredWithWhatIsMissing) {
  const Robot robot = tx60l();
  for (const std::size_t count : {2U, 4U, 5U}) {
    const Identification r = identify(robot, measure(robot, truth(), count, 31), "data", {});
    EXPECT_FALSE(r.identifiability.missing.empty()) << count;
    EXPECT_FALSE(r.doubts.empty());
    EXPECT_EQ(r.identifiable + r.identifiability.missing.size(), 36U) << count;
    EXPECT_FALSE(r.identifiability.suggested_poses.empty());
  }
}

/// Joint readings that hold the tool's orientation while its position varies, by Newton on the nominal arm.
std::vector<arms::Joints> one_orientation(const Robot& robot, std::size_t count) {
  const auto model = prepare(TermSet(), robot, "nominal");
  const arms::NominalJacobian jacobian(robot.nominal);
  const arms::Joints middle{0.3, 0.5, 1.2, 0.2, 0.9, -0.4};
  const Pose<double> wanted = nominal_forward(*model, middle);
  arms::Random random(5);
  std::vector<arms::Joints> poses;
  while (poses.size() < count) {
    Pose<double> shifted = wanted;
    shifted.position += Eigen::Vector3d(random.around(0.2), random.around(0.2), random.around(0.2));
    if (const auto q = oriented::reach(robot, *model, jacobian, middle, shifted)) poses.push_back(*q);
  }
  return poses;
}

TEST(Identify, OneOrientationIsAnsweredWithWhatIsMissingAndTheCureCures) {
  const Robot robot = tx60l();
  const auto model = prepare(truth(), robot, "truth");
  std::mt19937_64 random(1);
  const Measuring how;
  std::vector<Observation> rows;
  for (const arms::Joints& q : one_orientation(robot, 40))
    rows.push_back(measure(*model, q, rows.size(), how, random));
  const Identification r = identify(robot, rows, "data", {});
  EXPECT_FALSE(r.identifiability.missing.empty());
  ASSERT_FALSE(r.identifiability.suggested_poses.empty());
  ASSERT_LE(r.identifiability.suggested_poses.size(), 20U);
  for (const auto& c : r.identifiability.suggested_poses)
    rows.push_back(measure(*model, c.q_rad, rows.size(), how, random));
  const Identification cured = identify(robot, rows, "data", {});
  EXPECT_TRUE(cured.identifiability.missing.empty()) << cured.identifiability.missing.front();
  EXPECT_EQ(cured.identifiable, 36U);
}

TEST(Identify, AnotherUnitOrAnotherArmIsRefusedWithTheSuspicion) {
  const Robot robot = tx60l();
  const auto rows = measure(robot, truth(), 30, 41);
  auto metres = rows;
  for (Observation& row : metres) row.p_m *= 1e-3;
  support::expect_refused([&] { identify(robot, metres, "m.csv", {}); }, 0, "x_mm y_mm z_mm",
                          {"m.csv", "metres"});
  for (const arms::Robot& nominal : {arms::rx160l(), arms::ur10()}) {
    Robot other = tx60l();
    other.nominal = nominal;
    for (JointLimits& l : other.nominal.limits) l = {-7, 7};
    support::expect_refused([&] { identify(other, rows, "other.csv", {}); }, 0, "x_mm y_mm z_mm",
                            {"another arm"});
  }
  EXPECT_NO_THROW(identify(robot, metres, "m.csv", {.force = true}));
}

}  // namespace
