// SPDX-License-Identifier: Apache-2.0
// Arms whose axes 2, 3 and 4 are parallel, nearly so in truth, or nearly so in their drawing: what is identified stays of
// the size of the errors, and no d of metres comes out, goes in or is left over.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "exchange/axis_chain.hpp"
#include "exchange/imported_arm.hpp"
#include "identification/identify.hpp"
#include "identification/residuals.hpp"
#include "identification/validate.hpp"
#include "model/host_model.hpp"
#include "model/paper_model.hpp"
#include "support/arms.hpp"
#include "support/measuring.hpp"
#include "support/moving_arm.hpp"
#include "support/robot_files.hpp"
#include "support/text_file.hpp"
#include "units.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;

struct Views {
  double spread_rad = 3;  ///< of each joint around a middle pose
  std::size_t count = 60;
  bool pose = true;
  std::uint64_t seed = 1;
};

/// What a tracker sees of the arm `truth`, without any term: its nominal numbers are the true ones.
std::vector<Observation> views(const Robot& truth, const Views& how) {
  const auto model = prepare(TermSet(), truth, "truth");
  measuring::Measuring measuring;
  measuring.pose = how.pose;
  std::mt19937_64 noise(how.seed);
  arms::Random random(how.seed);
  std::vector<Observation> rows;
  for (std::size_t k = 0; k < how.count; ++k) {
    arms::Joints q = random.joints(how.spread_rad);
    const arms::Joints middle{0.2, -1.2, 1.4, -0.9, 1.1, 0.3};
    for (std::size_t i = 0; i < 6; ++i) q[i] += middle[i];
    rows.push_back(measuring::measure(*model, q, k, measuring, noise));
  }
  return rows;
}

Robot with_tool(const std::string& name) {
  Robot robot = support::robot(name);
  robot.nominal.tool_xyz_m = {0.01, 0.03, 0.06};
  robot.position_sigma_m = measuring::kPosition;
  robot.orientation_sigma_rad = measuring::kOrientation;
  return robot;
}

/// The arm with the errors of manufacture on all of Eq. 1, and `tilt_rad` between the parallel axes.
Robot manufactured(Robot robot, double tilt_rad, std::uint64_t seed) {
  arms::Random random(seed);
  for (std::size_t i = 0; i < 6; ++i) {
    NominalLink& link = robot.nominal.links[i];
    link.theta_rad += random.around(radians(0.1));
    link.d_m += random.around(0.4e-3);
    link.a_m += random.around(0.4e-3);
    link.alpha_rad += random.around(radians(0.05));
    link.beta_rad += random.around(radians(0.05));
  }
  // About x it is an alpha, about y a beta, else both: the tilt's direction decides how far a common normal is off.
  for (const std::size_t i : {1U, 2U}) {
    const double direction = random.around(3.1);
    robot.nominal.links[i].alpha_rad += tilt_rad * std::cos(direction);
    robot.nominal.links[i].beta_rad += tilt_rad * std::sin(direction);
  }
  return robot;
}

/// The largest |change of d or a| (mm).
double longest_mm(const Calibration& calibration, const Robot& robot) {
  double longest = 0;
  for (const Parameter& p : parameters_of(calibration.terms, robot.nominal)) {
    const double value = p.get(calibration.terms);
    EXPECT_TRUE(std::isfinite(value)) << p.name;
    if (p.name.starts_with("link") && p.name.ends_with("_mm"))
      longest = std::max(longest, std::abs(value) * 1e3);
  }
  return longest;
}

/// The geometry of `drawing` by what is seen of `truth`.
Identification identified(const Robot& drawing, const Robot& truth, const Views& how = {}) {
  IdentifyOptions options;
  options.model = ModelKind::geometric;
  Identification r = identify(drawing, views(truth, how), "data", options);
  EXPECT_TRUE(r.fit.converged);
  return r;
}

/// Mean error (m) on views that were not identified from.
double mean_on_others(const Robot& drawing, const Calibration& calibration, const Robot& truth,
                      Views how = {}) {
  how.seed = 99;
  return validate(drawing, calibration, views(truth, how), "others").after.mean_m;
}

TEST(NearParallel, AnArmThatIsSlightlyOffParallelIsFoundWithSmallNumbers) {
  for (const char* file : {"ur5", "ur10", "tx60l", "kuka-kr6-r900"}) {
    const Robot drawing = with_tool(file);
    for (const double tilt_deg : {0.0, 0.001, 0.05, 0.3}) {
      const Robot truth = manufactured(drawing, radians(tilt_deg), 5);
      for (const bool pose : {true, false}) {
        Views how;
        how.pose = pose;
        const Identification r = identified(drawing, truth, how);
        EXPECT_TRUE(r.identifiability.missing.empty()) << r.identifiability.missing.front();
        const Calibration& found = r.calibration;
        EXPECT_LT(longest_mm(found, drawing), 2) << file << " " << tilt_deg;
        const double mean = mean_on_others(drawing, found, truth, how);
        EXPECT_LT(mean, 0.12e-3) << file << " " << tilt_deg << (pose ? " pose" : " position");
      }
    }
  }
}

// In a corner of the workspace the lengths of parallel links are hardly known; they must come out unknown, not large.
TEST(NearParallel, ASmallCornerOfTheWorkspaceLetsNothingRunOff) {
  for (const char* file : {"ur5", "ur10"}) {
    const Robot drawing = with_tool(file);
    const Robot truth = manufactured(drawing, radians(0.05), 6);
    for (const double spread_deg : {30.0, 10.0}) {
      Views how;
      how.count = 200;
      how.spread_rad = radians(spread_deg);
      const double longest = longest_mm(identified(drawing, truth, how).calibration, drawing);
      std::printf("%s, +-%.0f deg: longest change %.2f mm\n", file, spread_deg, longest);
      EXPECT_LT(longest, 10) << file << " " << spread_deg;
    }
  }
}

// A drawing may itself have axes that are not quite parallel, on either side of what decides between d and
// beta.
TEST(NearParallel, ADrawingThatIsSlightlyOffParallelTakesEitherParameter) {
  for (const double tilt_deg : {0.01, 0.5, 2.0, 5.0, 14.9, 15.1, 25.0}) {
    Robot drawing = with_tool("ur10");
    for (const std::size_t i : {1U, 2U}) {
      drawing.nominal.links[i].alpha_rad += radians(i == 1 ? tilt_deg : 0);
      drawing.nominal.links[i].beta_rad += radians(i == 1 ? 0 : tilt_deg);
    }
    EXPECT_EQ(takes_beta(drawing.nominal)[1], tilt_deg < 15);
    EXPECT_EQ(takes_beta(drawing.nominal)[2], tilt_deg < 15);
    const Robot truth = manufactured(drawing, 0, 8);
    const Calibration found = identified(drawing, truth).calibration;
    const double mean = mean_on_others(drawing, found, truth);
    std::printf("drawn %.2f deg off parallel: longest change %.2f mm, %.4f mm on others\n", tilt_deg,
                longest_mm(found, drawing), mean * 1e3);
    EXPECT_LT(longest_mm(found, drawing), 10) << tilt_deg;
    EXPECT_LT(mean, 0.12e-3) << tilt_deg;
  }
}

/// The same axes in plain Denavit-Hartenberg, with the common normals wherever they are: as makers calibrate.
NominalRobot<6> plain_table(const NominalRobot<6>& robot) {
  const AxisChain chain = axes_of(robot);
  NominalRobot<6> table = robot;
  Pose<double> frame;
  for (std::size_t i = 0; i + 1 < 6; ++i) {
    const Eigen::Vector3d w = frame.rotation.transpose() * chain.axes[i + 1].direction;
    const Eigen::Vector3d p = frame.rotation.transpose() * (chain.axes[i + 1].point_m - frame.position);
    const double sine = std::hypot(w.x(), w.y());
    const Eigen::Vector3d x(-w.y() / sine, w.x() / sine, 0);
    NominalLink& link = table.links[i];
    link.theta_rad = std::atan2(x.y(), x.x());
    link.a_m = p.dot(x);
    link.alpha_rad = std::atan2(sine, w.z());
    link.d_m = p.z() - (p.x() * w.x() + p.y() * w.y()) / (sine * sine) * w.z();
    link.beta_rad = 0;
    frame = frame * link_pose(link, 0);
  }
  // What is left for link 6 and the tool is a general transform.
  const Pose<double> rest{frame.rotation.transpose() * chain.tip.rotation,
                          frame.rotation.transpose() * (chain.tip.position - frame.position)};
  const Eigen::Quaterniond q(rest.rotation);
  table.links[5] = NominalLink();
  table.tool_xyz_m = {rest.position.x(), rest.position.y(), rest.position.z()};
  table.tool_wxyz = {q.w(), q.x(), q.y(), q.z()};
  return table;
}

// The maker's calibrated table of a UR5: hundreds of metres that cancel. It is refused as it is; imported, it is the same
// arm with lengths of the drawing, and a better drawing to identify from.
TEST(NearParallel, AMakersCalibratedTableIsImportedAndIdentifiedFrom) {
  const Robot drawing = with_tool("ur5");
  double longest = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Robot maker = manufactured(drawing, radians(0.05), seed);
    Robot table = maker;
    table.nominal = plain_table(maker.nominal);
    double here = 0;
    for (const NominalLink& link : table.nominal.links) here = std::max(here, std::abs(link.d_m));
    longest = std::max(longest, here);
    const std::string path = support::write("table" + std::to_string(seed) + ".yaml", robot_text(table, {}));
    if (here > longest_link_m) {
      EXPECT_THROW(load_robot(path), InputError);
    }
    const ImportedArm imported = import_robot(path);
    const support::MovingArm before(maker);
    const support::MovingArm after(imported.robot);
    arms::Random random(seed);
    for (int k = 0; k < 100; ++k) {
      const arms::Joints q = random.pose(maker.nominal);
      const Pose<double> a = before(q);
      const Pose<double> b = after(q);
      ASSERT_LT((a.position - b.position).norm(), 1e-9);
      ASSERT_LT(arms::angle_between(a.rotation, b.rotation), 1e-9);
    }
    for (std::size_t i = 0; i < 6; ++i) {
      EXPECT_NEAR(imported.robot.nominal.links[i].a_m, drawing.nominal.links[i].a_m, 5e-3)
          << seed << " " << i;
      EXPECT_LT(std::abs(imported.robot.nominal.links[i].d_m), 0.25) << seed << " " << i;
    }
    if (seed > 3) continue;
    Robot start = imported.robot;
    start.position_sigma_m = drawing.position_sigma_m;
    start.orientation_sigma_rad = drawing.orientation_sigma_rad;
    const Robot truth = manufactured(maker, 0, seed + 100);
    const Calibration found = identified(start, truth).calibration;
    EXPECT_LT(longest_mm(found, start), 5);
    EXPECT_LT(mean_on_others(start, found, truth), 0.12e-3);
  }
  std::printf("longest d in the tables: %.0f m\n", longest);
  EXPECT_GT(longest, 100);
}

}  // namespace
