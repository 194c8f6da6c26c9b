// SPDX-License-Identifier: Apache-2.0
// Two real arms, measured by others (../shared/data): what the geometric model with link gravity reaches on poses that
// were not fitted, and that nothing runs off although three axes are parallel.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "identification/identify.hpp"
#include "identification/validate.hpp"
#include "measurement/measured_data.hpp"
#include "measurement/observation.hpp"
#include "support/measured_arm.hpp"
#include "support/robot_files.hpp"
#include "units.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;

IdentifyOptions geometry_and_gravity(bool robust) {
  return {.model = ModelKind::no_stiffness, .estimator = {.robust = robust}};
}

const char* name_of(const IdentifyOptions& options) {
  if (options.model == ModelKind::full) return "full model, robust";
  return options.estimator.robust ? "robust" : "plain";
}

/// No geometric error of a maker's arm is larger: what is, ran off along a direction that the data do not know.
void expect_small(const Calibration& calibration, const Robot& robot) {
  for (const Parameter& p : parameters_of(calibration.terms, robot.nominal)) {
    const double value = p.get(calibration.terms);
    ASSERT_TRUE(std::isfinite(value)) << p.name;
    if (p.name.ends_with("_mm")) {
      EXPECT_LT(std::abs(value), 10e-3) << p.name;
    }
    if (p.name.ends_with("_deg")) {
      EXPECT_LT(std::abs(value), radians(2)) << p.name;
    }
  }
}

/// Mean error (mm) on a random third, fitted on the rest.
double held_out_third(const Robot& robot, std::vector<Observation> rows, unsigned split,
                      const IdentifyOptions& options) {
  const Thirds parts(std::move(rows), split);
  const Identification r = identify(robot, parts.train, "train", options);
  EXPECT_TRUE(r.fit.converged);
  if (options.model != ModelKind::full) expect_small(r.calibration, robot);
  const ErrorStatistics after = validate(robot, r.calibration, parts.test, "held out").after;
  std::printf("  split %u, %s: held out %.4f mm mean, %.4f rms, %.4f max; %zu outliers\n", split,
              name_of(options), after.mean_m * 1e3, after.rms_m * 1e3, after.max_m * 1e3, r.outliers.size());
  return after.mean_m * 1e3;
}

TEST(MeasuredArms, Ur5FromTheGridToTheSourcesRandomPoses) {
  const auto ur5 = measured_arm("ur5-jacobi");
  if (!ur5) GTEST_SKIP() << "REAL DATA: not run";
  for (const bool robust : {false, true}) {
    const Identification r =
        identify(ur5->robot, ur5->rows("grid.csv"), "grid.csv", geometry_and_gravity(robust));
    const double mean =
        validate(ur5->robot, r.calibration, ur5->rows("random.csv"), "random.csv").after.mean_m;
    std::printf("  UR5, %s: random poses %.4f mm mean; %zu outliers\n", robust ? "robust" : "plain",
                mean * 1e3, r.outliers.size());
    EXPECT_LE(mean, 0.100e-3);
    EXPECT_TRUE(r.fit.converged);
    expect_small(r.calibration, ur5->robot);
  }
  const Identification full = identify(ur5->robot, ur5->rows("grid.csv"), "grid.csv", {});
  const double mean =
      validate(ur5->robot, full.calibration, ur5->rows("random.csv"), "random.csv").after.mean_m;
  std::printf("  UR5, %s: random poses %.4f mm mean\n", name_of({}), mean * 1e3);
  EXPECT_LE(mean, 0.105e-3);
  EXPECT_TRUE(full.fit.converged);
  // Near-parallel axes and a tool point on axis 6 must not let lengths run off.
  for (const Term<double>& t : full.calibration.terms.terms) EXPECT_LT(std::abs(t.coefficient), 0.05);
}

/// One random third scatters by some 0.01 mm, as the mean of 500 errors of 0.2 mm spread must.
void expect_on_held_out_thirds(const Robot& robot, const std::vector<Observation>& rows, double most_mm) {
#if defined(__SANITIZE_ADDRESS__)  // ten times slower
  constexpr unsigned splits = 1;
#else
  constexpr unsigned splits = 3;
#endif
  for (const bool robust : {false, true}) {
    double mean = 0;
    for (unsigned split = 1; split <= splits; ++split)
      mean += held_out_third(robot, rows, split, geometry_and_gravity(robust)) / splits;
    std::printf("  %s, %u splits: %.4f mm\n", robust ? "robust" : "plain", splits, mean);
    EXPECT_LE(mean, most_mm);
  }
}

TEST(MeasuredArms, Ur10SeriesAOnAHeldOutThird) {
  const auto ur10 = measured_arm("ur10-ipa");
  if (!ur10) GTEST_SKIP() << "REAL DATA: not run";
  std::vector<Observation> rows = ur10->rows("series_a.csv");
  rows.resize(1500);
  expect_on_held_out_thirds(ur10->robot, rows, 0.37);
}

TEST(MeasuredArms, Ur10SeriesBOnAHeldOutThird) {
  const auto ur10 = measured_arm("ur10-ipa");
  if (!ur10) GTEST_SKIP() << "REAL DATA: not run";
  const std::vector<Observation> rows = ur10->rows("series_b.csv");
  expect_on_held_out_thirds(ur10->robot, rows, 0.38);
  for (const unsigned split : {1U, 2U, 3U}) EXPECT_LE(held_out_third(ur10->robot, rows, split, {}), 0.40);
}

// The project's own robot files hold the same arms as the data's.
TEST(MeasuredArms, TheProjectsRobotFilesAreTheseArms) {
  for (const auto& [folder, name] :
       std::map<std::string, std::string>{{"ur5-jacobi", "ur5"}, {"ur10-ipa", "ur10"}}) {
    const auto theirs = measured_arm(folder);
    if (!theirs) GTEST_SKIP() << "REAL DATA: not run";
    EXPECT_EQ(nominal_hash(support::robot(name).nominal), nominal_hash(theirs->robot.nominal)) << name;
  }
}

}  // namespace
