// SPDX-License-Identifier: Apache-2.0
// The model sizes of the paper (Fig. 3, Fig. 4, Table 3; docs/model.md, section 8) come out of one rank routine, on their own.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "identification/identifiability.hpp"
#include "model/paper_model.hpp"
#include "support/arms.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;

enum class Measured { pose, position };

Robot file_of(const arms::Robot& nominal) {
  Robot robot;
  robot.name = "arm";
  robot.nominal = nominal;
  return robot;
}

/// Columns of all parameters at random poses, with their order of preference.
struct Columns {
  std::vector<Parameter> parameters;
  Eigen::MatrixXd derivative;
  std::vector<std::size_t> order;
};

Columns columns(const Robot& robot, ModelKind kind, Measured measured, std::size_t poses, std::uint64_t seed,
                double position_sigma_m = 0.035e-3, double orientation_sigma_rad = 0.007 * arms::deg) {
  Observation like;
  like.context = default_context<double>(robot.nominal);
  like.has_orientation = measured == Measured::pose;
  like.whitening.setZero();
  like.whitening.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() / position_sigma_m;
  if (like.has_orientation)
    like.whitening.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() / orientation_sigma_rad;
  const ParametricModel paper = paper_model(robot.nominal, kind, true);
  const Unknowns unknowns{{}, paper.parameters, {}};
  const Estimate estimate{paper.set, {}, {}};
  const auto model = prepare(estimate.set, robot, "test");
  const auto rows = random_observations(robot, {like}, poses, seed);
  return {paper.parameters, linearised(estimate, *model, rows, unknowns).derivative,
          elimination_order(unknowns, estimate.set)};
}

struct Sizes {
  std::size_t parameters;
  std::size_t identifiable;
  std::vector<std::string> lost;
};

Sizes sizes(const Robot& robot, ModelKind kind, Measured measured, std::size_t poses, std::uint64_t seed) {
  const Columns c = columns(robot, kind, measured, poses, seed);
  const Elimination e = eliminate(c.derivative, c.order);
  Sizes s{c.parameters.size(), e.kept.size(), {}};
  for (const DependentColumn& l : e.dependent) s.lost.push_back(c.parameters[l.column].name);
  return s;
}

arms::Robot with_tool(arms::Robot r, double x_mm, double y_mm, double z_mm) {
  r.tool_xyz_m = {x_mm * 1e-3, y_mm * 1e-3, z_mm * 1e-3};
  r.tool_wxyz = {1, 0, 0, 0};
  return r;
}

arms::Robot with_centre_of_mass_on_axis_6(arms::Robot r) {
  r.payload_com_m = {0, 0, 0.06};
  return r;
}

const std::vector<std::string> kLostInPaper{"base.z_mm", "base.rz_deg",
                                            "joint_compliance[joint=1].rad_per_nm"};

TEST(ModelSizes, FullPoseKnows36And28OfThePapersParameters) {
  for (const std::size_t poses : {14, 40, 1000}) {
    for (const std::uint64_t seed : {1, 2, 3}) {
      const Robot robot = file_of(arms::tx60l());
      const Sizes full = sizes(robot, ModelKind::full, Measured::pose, poses, seed);
      EXPECT_EQ(full.parameters, 39U);
      EXPECT_EQ(full.identifiable, 36U) << poses << " poses";
      EXPECT_EQ(full.lost, kLostInPaper);
      EXPECT_EQ(sizes(robot, ModelKind::geometric, Measured::pose, poses, seed).identifiable, 28U);
      EXPECT_EQ(sizes(robot, ModelKind::no_gravity, Measured::pose, poses, seed).identifiable, 33U);
      EXPECT_EQ(sizes(robot, ModelKind::no_stiffness, Measured::pose, poses, seed).identifiable, 31U);
    }
  }
}

TEST(ModelSizes, ACentreOfMassOnAxis6LosesItsCompliance) {
  const Robot robot = file_of(with_centre_of_mass_on_axis_6(arms::tx60l()));
  const Sizes s = sizes(robot, ModelKind::full, Measured::pose, 100, 4);
  EXPECT_EQ(s.identifiable, 35U);
  EXPECT_TRUE(std::ranges::count(s.lost, "joint_compliance[joint=6].rad_per_nm"));
  EXPECT_EQ(sizes(robot, ModelKind::geometric, Measured::pose, 100, 4).identifiable, 28U);
}

TEST(ModelSizes, PositionsOffAxis6Know35And27) {
  for (const std::size_t poses : {40, 1000}) {
    const Robot robot = file_of(with_tool(arms::tx60l(), 10, 30, 60));
    EXPECT_EQ(sizes(robot, ModelKind::full, Measured::position, poses, 5).identifiable, 35U);
    EXPECT_EQ(sizes(robot, ModelKind::geometric, Measured::position, poses, 5).identifiable, 27U);
  }
}

// The paper (Table 3) counts 32 here: it keeps the compliance of joint 6, for which it prints 5.17 N·m/rad. But joint 6
// turns about a line through the flange origin, so that no position measured there moves with it: its column is zero,
// and what a QR of normalised columns finds in it is the rounding of z6 x (p - p6). Geometry 24, joints 2 to 5, three
// gravity coefficients: 31.
TEST(ModelSizes, PositionsAtTheFlangeKnow24AndSevenOfTheFlexible) {
  for (const std::size_t poses : {40, 1000}) {
    const Robot robot = file_of(with_tool(arms::tx60l(), 0, 0, 0));
    const Sizes s = sizes(robot, ModelKind::full, Measured::position, poses, 6);
    EXPECT_EQ(s.identifiable, 31U);
    EXPECT_TRUE(std::ranges::count(s.lost, "joint_compliance[joint=6].rad_per_nm"));
    EXPECT_EQ(sizes(robot, ModelKind::geometric, Measured::position, poses, 6).identifiable, 24U);
  }
}

TEST(ModelSizes, OtherArmsHaveThePapersSizesToo) {
  const Robot heavy = file_of(arms::rx160l());
  EXPECT_EQ(sizes(heavy, ModelKind::full, Measured::pose, 100, 7).identifiable, 36U);
  // Two pairs of parallel axes: beta instead of d on links 2 and 3 keeps the number at 24 + 6.
  const Robot parallel = file_of(arms::ur10());
  const Sizes s = sizes(parallel, ModelKind::geometric, Measured::pose, 100, 8);
  EXPECT_EQ(s.parameters, 30U);
  EXPECT_EQ(s.identifiable, 28U);
}

/// Of all 39 at random full poses, unwhitened.
Columns full_model(const Robot& robot, std::size_t poses, std::uint64_t seed) {
  return columns(robot, ModelKind::full, Measured::pose, poses, seed, 1, 1);
}

// The sizes must not depend on the noise, nor on how the weak columns are scaled.
TEST(ModelSizes, TheWeakestKeptColumnIsFarAboveTheThreshold) {
  const Robot robot = file_of(with_tool(arms::tx60l(), 10, 30, 60));
  const Columns full = full_model(robot, 14, 9);
  for (const double tolerance : {1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10}) {
    EXPECT_EQ(eliminate(full.derivative, full.order, tolerance).kept.size(), 36U) << tolerance;
  }
}

TEST(ModelSizes, EveryLostColumnNamesWhatCarriesIt) {
  const Robot robot = file_of(arms::tx60l());
  const Columns full = full_model(robot, 200, 10);
  const Elimination e = eliminate(full.derivative, full.order);
  ASSERT_EQ(e.dependent.size(), 3U);
  const auto name = [&](std::size_t c) { return full.parameters[c].name; };
  ASSERT_EQ(e.dependent[0].with.size(), 1U);
  EXPECT_EQ(name(e.dependent[0].column), "base.z_mm");
  EXPECT_EQ(name(e.dependent[0].with[0]), "link1.d_mm");
  ASSERT_EQ(e.dependent[1].with.size(), 1U);
  EXPECT_EQ(name(e.dependent[1].with[0]), "link1.theta_deg");
  EXPECT_TRUE(e.dependent[2].with.empty()) << "gravity makes no torque about a vertical axis";
}

}  // namespace
