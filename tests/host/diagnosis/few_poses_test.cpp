// SPDX-License-Identifier: Apache-2.0
// Measured arms with as few poses as people measure: one draw of each series, against two simple regressions.
#include "host/diagnosis/few_poses.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "diagnosis/diagnose.hpp"
#include "files/calibration_file.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;

TEST(FewPoses, PredictsBetterThanRidgeRegression) {
  double log_sum = 0;
  int cells = 0;
  for (const auto& [series, poses] :
       {std::pair{"ur10-b", 20U}, {"ur10-b", 40U}, {"ur10-a", 60U}, {"ur5", 100U}}) {
    const auto rows = few_poses(series, poses, 1);
    if (!rows) GTEST_SKIP() << "REAL DATA: not run";
    const Identification start = identify(rows->robot, rows->train, series, {});
    DiagnoseOptions options;
    options.columns = rows->columns;
    const Diagnosis d = diagnose(rows->robot, rows->train, series, options);
    const double mean = mean_with(*rows, d.after);
    const double ridge = mean_of_ridge(*rows, start);
    const double process = mean_of_gaussian_processes(*rows, start);
    std::printf("  %s, %u poses: identify %.3f, diagnose %.3f, ridge %.3f, processes %.3f mm\n", series,
                poses, mean_with(*rows, start.calibration) * 1e3, mean * 1e3, ridge * 1e3, process * 1e3);
    EXPECT_LT(mean, ridge) << series;
    EXPECT_LT(mean, 1.1 * process) << series;
    log_sum += std::log(mean / ridge);
    ++cells;
    // What is carried is marked as such, and zero where nothing was measured.
    ASSERT_TRUE(d.remainder) << series;
    for (const CarriedCurve& c : d.remainder->curves) {
      const bool marked = std::ranges::find(d.after.regularised, c.joint) != d.after.regularised.end();
      EXPECT_EQ(marked, !c.named);
    }
    const std::string text = calibration_text(d.after, rows->robot);
    EXPECT_EQ(text.find("regularised: true") != std::string::npos, !d.after.regularised.empty());
  }
  EXPECT_LT(std::exp(log_sum / cells), 0.8);
}

TEST(FewPoses, ACalibrationWithARemainderIsReadAndSearchedAnew) {
  const auto rows = few_poses("ur10-b", 40, 0);
  if (!rows) GTEST_SKIP() << "REAL DATA: not run";
  DiagnoseOptions options;
  options.columns = rows->columns;
  const Diagnosis first = diagnose(rows->robot, rows->train, "B", options);
  ASSERT_FALSE(first.after.regularised.empty());
  options.start = first.after;
  const Diagnosis again = diagnose(rows->robot, rows->train, "B", options);
  EXPECT_GT(again.error_before.rms_m, 2 * again.error_after.rms_m);  // the curves were left out at the start
  EXPECT_LT(mean_with(*rows, again.after), 1.1 * mean_with(*rows, first.after));
}

}  // namespace
