// SPDX-License-Identifier: Apache-2.0
// Two real arms whose joints turn by curves of their own: found on some poses, shown on others, and four months later.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <set>
#include <string>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "files/data_file.hpp"
#include "identification/fitted_calibration.hpp"
#include "identification/identify.hpp"
#include "identification/validate.hpp"
#include "support/measured_arm.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;

double mean_mm(const MeasuredArm& arm, const Calibration& calibration, const std::vector<Observation>& rows) {
  return validate(arm.robot, calibration, rows, "held out").after.mean_m * 1e3;
}

Diagnosis diagnosed(const MeasuredArm& arm, const std::string& file, const std::vector<Observation>& rows) {
  DiagnoseOptions options;
  options.columns = load_data(arm.folder + file, arm.robot).columns;
  const auto begin = std::chrono::steady_clock::now();
  Diagnosis d = diagnose(arm.robot, rows, file, options);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  std::printf("  %s: %zu rows in %.1f s:", file.c_str(), rows.size(), seconds.count());
  for (const FoundEffect& e : d.effects) std::printf(" %s", name(e.id).c_str());
  std::printf("\n");
  return d;
}

std::set<unsigned> joints_with_curves(const Diagnosis& d) {
  std::set<unsigned> joints;
  for (const FoundEffect& e : d.effects) {
    if (e.id.effect == Effect::joint_curve) joints.insert(e.id.joint);
  }
  return joints;
}

/// The effects of one calibration as they are, and everything that another start fits besides fitted anew.
Calibration with_effects_of(const Calibration& other, const Identification& start, const MeasuredArm& arm,
                            const std::vector<Observation>& rows) {
  std::set<std::string> names;
  for (const Parameter& p : start.identifiability.fitted.parameters) names.insert(p.name);
  Unknowns unknowns{.frames = start.identifiability.fitted.frames};
  for (Parameter& p : parameters_of(other.terms, arm.robot.nominal)) {
    if (names.count(p.name) != 0) unknowns.parameters.push_back(std::move(p));
  }
  EXPECT_EQ(unknowns.parameters.size(), names.size());
  const Estimate at{other.terms, start.fit.estimate.f, start.fit.estimate.e};
  const Fit moved = fit(at, unknowns, rows, arm.robot);
  EXPECT_TRUE(moved.converged);
  return fitted_calibration(moved, unknowns, arm.robot, rows);
}

TEST(MeasuredArms, Ur5FromTheGridToTheSourcesRandomPoses) {
  const auto ur5 = measured_arm("ur5-jacobi");
  if (!ur5) GTEST_SKIP() << "REAL DATA: not run";
  const std::vector<Observation> random = ur5->rows("random.csv");
  const Diagnosis d = diagnosed(*ur5, "grid.csv", ur5->rows("grid.csv"));
  const double before = mean_mm(*ur5, d.before, random);
  const double after = mean_mm(*ur5, d.after, random);
  std::printf("  UR5: mean error at the random poses %.4f -> %.4f mm\n", before, after);
  EXPECT_LE(after, 0.064);
  const std::set<unsigned> joints = joints_with_curves(d);
  for (const unsigned joint : {1U, 2U, 3U}) EXPECT_EQ(joints.count(joint), 1U) << joint;
}

TEST(MeasuredArms, Ur10AndTheSameArmFourMonthsLater) {
  const auto ur10 = measured_arm("ur10-ipa");
  if (!ur10) GTEST_SKIP() << "REAL DATA: not run";
  std::vector<Observation> a = ur10->rows("series_a.csv");
  a.resize(1500);
  const Thirds first(a, 1);
  const Diagnosis d = diagnosed(*ur10, "series_a.csv", first.train);
  const double before = mean_mm(*ur10, d.before, first.test);
  const double after = mean_mm(*ur10, d.after, first.test);
  std::printf("  A: mean error on the held-out third %.4f -> %.4f mm\n", before, after);
  EXPECT_LE(after, 0.070);
  const std::set<unsigned> joints = joints_with_curves(d);
  for (const unsigned joint : {1U, 2U, 3U}) EXPECT_EQ(joints.count(joint), 1U) << joint;

  const Thirds later(ur10->rows("series_b.csv"), 1);
  const Identification start = identify(ur10->robot, later.train, "series_b.csv", {});
  const double without = mean_mm(*ur10, start.calibration, later.test);
  const double with = mean_mm(*ur10, with_effects_of(d.after, start, *ur10, later.train), later.test);
  std::printf("  B, four months later: %.4f mm, with what was found in A %.4f mm\n", without, with);
  EXPECT_LT(with, 0.75 * without);
}

TEST(MeasuredArms, Ur10SeriesB) {
  const auto ur10 = measured_arm("ur10-ipa");
  if (!ur10) GTEST_SKIP() << "REAL DATA: not run";
  const Thirds parts(ur10->rows("series_b.csv"), 1);
  const Diagnosis d = diagnosed(*ur10, "series_b.csv", parts.train);
  const double before = mean_mm(*ur10, d.before, parts.test);
  const double after = mean_mm(*ur10, d.after, parts.test);
  std::printf("  B: mean error on the held-out third %.4f -> %.4f mm\n", before, after);
  EXPECT_LE(after, 0.100);
}

}  // namespace
