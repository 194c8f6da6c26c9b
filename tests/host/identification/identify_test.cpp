// SPDX-License-Identifier: Apache-2.0
// Identification against the paper's figures, against what no data can know, and against measured arms.
#include "identification/identify.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <random>
#include <string>

#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "flexcomp/forward.hpp"
#include "flexcomp/identification.hpp"
#include "identification/validate.hpp"
#include "input_error.hpp"
#include "measurement/observation.hpp"
#include "model/effects.hpp"
#include "support/arms.hpp"
#include "support/measuring.hpp"
#include "units.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;
using measuring::measure;
using measuring::Measuring;
using measuring::truth;
using measuring::tx60l;

ErrorStatistics held_out(const Robot& robot, const Calibration& c, const std::vector<Observation>& rows) {
  return validate(robot, c, rows, "held out").after;
}

IdentifyOptions plain() {
  IdentifyOptions o;
  o.estimator.robust = false;
  o.physical = false;
  return o;
}

TEST(Identify, NoiseFreePosesGiveThePapersErrorsBack) {
  const Robot robot = tx60l();
  Measuring how;
  how.noise = 0;
  const Identification r = identify(robot, measure(robot, truth(), 40, 1, how), "data", plain());
  EXPECT_EQ(r.parameters, 39U);
  EXPECT_EQ(r.identifiable, 36U);
  EXPECT_TRUE(r.identifiability.missing.empty());
  EXPECT_TRUE(r.fit.converged);
  EXPECT_LT(r.after.max_m, 1e-9);
  // Every number itself, with d1 + base z and theta1 + base rz lumped as the names say.
  std::map<std::string, double> true_value;
  for (const Parameter& p : parameters_of(truth(), robot.nominal)) true_value[p.name] = p.get(truth());
  true_value["link1.d_mm"] += true_value["base.z_mm"];
  true_value["link1.theta_deg"] += true_value["base.rz_deg"];
  std::size_t compared = 0;
  for (const Parameter& p : parameters_of(r.calibration.terms, robot.nominal)) {
    const double want = true_value.at(p.name);
    // Lumping is exact to first order only: base tilt times base height.
    EXPECT_NEAR(p.get(r.calibration.terms), want, 2e-3 * std::abs(want) + 1e-9) << p.name;
    ++compared;
  }
  EXPECT_EQ(compared, 36U);
}

// docs/model.md, M50: 14 random poses, N1, whitened least squares: mean score of the 36 is 0.82 +- 0.01.
TEST(Identify, ScoreOf14RandomPosesIsThePapers) {
  const Robot robot = tx60l();
  std::map<std::string, double> true_value;
  for (const Parameter& p : parameters_of(truth(), robot.nominal)) true_value[p.name] = p.get(truth());
  true_value["link1.d_mm"] += true_value["base.z_mm"];
  true_value["link1.theta_deg"] += true_value["base.rz_deg"];
  double sum = 0;
  int count = 0;
  for (std::uint64_t set = 0; set < 40; ++set) {
    const Identification r = identify(robot, measure(robot, truth(), 14, 100 + set), "data", plain());
    ASSERT_EQ(r.identifiable, 36U);
    double score = 0;
    for (const Parameter& p : parameters_of(r.calibration.terms, robot.nominal)) {
      const double want = true_value.at(p.name);
      score += std::max(0.0, 1 - std::abs(p.get(r.calibration.terms) - want) / std::abs(want)) / 36;
    }
    sum += score;
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
    IdentifyOptions o = plain();
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
  std::map<std::string, double> true_value;
  for (const Parameter& p : parameters_of(truth(), robot.nominal)) true_value[p.name] = p.get(truth());
  true_value["link1.d_mm"] += true_value["base.z_mm"];
  true_value["link1.theta_deg"] += true_value["base.rz_deg"];
  Measuring how;
  how.payload_kg = {0, 3};
  int inside = 0;
  int all = 0;
  double squares = 0;
  for (std::uint64_t set = 0; set < 30; ++set) {
    const Identification r =
        identify(robot, measure(robot, truth(), 40, 500 + set, how), "data", IdentifyOptions());
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
  const double clean =
      held_out(robot, identify(robot, rows, "data", IdentifyOptions()).calibration, others).mean_m;
  rows[7].p_m.x() += 5e-3;
  rows[31].p_m.z() -= 2e-3;
  rows[44].R = rotation_of({0.02, 0, 0}) * rows[44].R;
  const Identification r = identify(robot, rows, "data", IdentifyOptions());
  for (const std::size_t k : {7U, 31U, 44U}) {
    EXPECT_TRUE(std::count(r.outliers.begin(), r.outliers.end(), k)) << k;
  }
  EXPECT_LE(r.outliers.size(), 5U);
  EXPECT_LT(held_out(robot, r.calibration, others).mean_m, 1.1 * clean);
  EXPECT_GT(held_out(robot, identify(robot, rows, "data", plain()).calibration, others).mean_m, 1.5 * clean);
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
    const Identification r = identify(robot, rows, "data", IdentifyOptions());
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
    const Identification r = identify(robot, measure(robot, truth(), count, 31), "data", IdentifyOptions());
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
    Eigen::Vector3d shift(random.around(0.2), random.around(0.2), random.around(0.2));
    arms::Joints q = middle;
    for (int k = 0; k < 50; ++k) {
      const Pose<double> now = nominal_forward(*model, q);
      Eigen::Matrix<double, 6, 1> e;
      e << wanted.position + shift - now.position,
          rotation_vector(wanted.rotation * now.rotation.transpose());
      if (e.norm() < 1e-13) break;
      const Eigen::Matrix<double, 6, 1> dq = jacobian(q).fullPivLu().solve(e);
      for (std::size_t i = 0; i < 6; ++i) q[i] += std::clamp(dq[static_cast<Eigen::Index>(i)], -0.2, 0.2);
    }
    const Pose<double> now = nominal_forward(*model, q);
    bool good = (wanted.position + shift - now.position).norm() < 1e-10;
    for (std::size_t i = 0; i < 6; ++i) {
      good = good && q[i] > robot.nominal.limits[i].min_rad && q[i] < robot.nominal.limits[i].max_rad;
    }
    if (good) poses.push_back(q);
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
  const Identification r = identify(robot, rows, "data", IdentifyOptions());
  EXPECT_FALSE(r.identifiability.missing.empty());
  ASSERT_FALSE(r.identifiability.suggested_poses.empty());
  ASSERT_LE(r.identifiability.suggested_poses.size(), 20U);
  for (const auto& c : r.identifiability.suggested_poses)
    rows.push_back(measure(*model, c.q_rad, rows.size(), how, random));
  const Identification cured = identify(robot, rows, "data", IdentifyOptions());
  EXPECT_TRUE(cured.identifiability.missing.empty()) << cured.identifiability.missing.front();
  EXPECT_EQ(cured.identifiable, 36U);
}

TEST(Identify, AnotherUnitOrAnotherArmIsRefusedWithTheSuspicion) {
  const Robot robot = tx60l();
  const auto rows = measure(robot, truth(), 30, 41);
  auto metres = rows;
  for (Observation& row : metres) row.p_m *= 1e-3;
  try {
    identify(robot, metres, "m.csv", IdentifyOptions());
    FAIL() << "metres were taken for millimetres";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("m.csv"), std::string::npos) << e.what();
    EXPECT_NE(std::string(e.what()).find("metres"), std::string::npos) << e.what();
  }
  for (const arms::Robot& nominal : {arms::rx160l(), arms::ur10()}) {
    Robot other = tx60l();
    other.nominal = nominal;
    for (JointLimits& l : other.nominal.limits) l = {-7, 7};
    try {
      identify(other, rows, "other.csv", IdentifyOptions());
      FAIL() << "another arm's data were taken";
    } catch (const InputError& e) {
      EXPECT_NE(std::string(e.what()).find("another arm"), std::string::npos) << e.what();
    }
  }
  IdentifyOptions forced;
  forced.force = true;
  EXPECT_NO_THROW(identify(robot, metres, "m.csv", forced));
}

std::string data_folder() {
  if (const char* set = std::getenv("FLEXCOMP_DATA")) return set;
  return std::string(FLEXCOMP_SOURCE_DIR) + "/../shared/data";
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

TEST(MeasuredArms, Ur5FromTheGridToRandomPoses) {
  const std::string folder = data_folder() + "/ur5-jacobi/";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "REAL DATA: not run, " << folder << " is absent";
  const Robot robot = load_robot(folder + "robot.yaml");
  const auto start = std::chrono::steady_clock::now();
  const auto rows = observe(load_data(folder + "grid.csv", robot), robot);
  const Identification r = identify(robot, rows, "grid.csv", IdentifyOptions());
  const double seconds = seconds_since(start);
  const auto random = observe(load_data(folder + "random.csv", robot), robot);
  const double mean = held_out(robot, r.calibration, random).mean_m * 1e3;
  std::printf("UR5 grid -> random: mean %.4f mm in %.1f s\n", mean, seconds);
  EXPECT_LE(mean, 0.105);
  EXPECT_TRUE(r.fit.converged);
  // Near-parallel axes and a tool point on axis 6 must not let lengths run off.
  for (const Term<double>& t : r.calibration.terms.terms) EXPECT_LT(std::abs(t.coefficient), 0.05);
}

TEST(MeasuredArms, Ur10SeriesBOnAHeldOutThird) {
  const std::string folder = data_folder() + "/ur10-ipa/";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "REAL DATA: not run, " << folder << " is absent";
  const Robot robot = load_robot(folder + "robot.yaml");
  auto rows = observe(load_data(folder + "series_b.csv", robot), robot);
  for (const unsigned split : {1U, 2U, 3U}) {
    std::mt19937 random(split);
    std::shuffle(rows.begin(), rows.end(), random);
    const auto third = static_cast<std::ptrdiff_t>(rows.size() / 3);
    const std::vector<Observation> test(rows.begin(), rows.begin() + third);
    const std::vector<Observation> train(rows.begin() + third, rows.end());
    const auto start = std::chrono::steady_clock::now();
    const Identification r = identify(robot, train, "series_b.csv", IdentifyOptions());
    const double seconds = seconds_since(start);
    const double mean = held_out(robot, r.calibration, test).mean_m * 1e3;
    std::printf("UR10 B, split %u: held-out mean %.4f mm, %zu outliers, %.1f s\n", split, mean,
                r.outliers.size(), seconds);
    EXPECT_LE(mean, 0.40);
    EXPECT_TRUE(r.fit.converged);
  }
}

}  // namespace
