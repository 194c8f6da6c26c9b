// SPDX-License-Identifier: Apache-2.0
// The sides of an arm tell its ways to a pose apart as ABB's cfx does: each way has a cfx of its own, and in plain postures it
// is the one of the manual's table.
#include "exchange/arm_sides.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <map>

#include "kinematics/nominal_inverse.hpp"
#include "support/arms.hpp"
#include "support/moving_arm.hpp"
#include "support/robot_files.hpp"
#include "units.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;
using Q = std::array<double, joint_count>;

/// The one that fits; -1 where none or several do.
int cfx_of(const Robot& robot, const Q& q) {
  const auto sides = arm_sides(robot.nominal, q);
  int found = -1;
  for (int cfx = 0; sides && cfx < 8; ++cfx) {
    if (!fits_cfx(*sides, cfx)) continue;
    if (found >= 0) return -1;
    found = cfx;
  }
  return found;
}

TEST(ArmSides, AreThoseOfTheTableInPlainPostures) {
  const Robot robot = support::robot("abb-irb120");
  const double d = radians(1);
  // Readings 0: upper arm up, forearm forward. The forearm passes the line of the upper arm 77 deg above its reading 0.
  EXPECT_EQ(cfx_of(robot, Q{0, 0, 0, 0, 30 * d, 0}), 0);
  EXPECT_EQ(cfx_of(robot, Q{100 * d, 0, 0, 20 * d, -30 * d, 0}), 1);
  EXPECT_EQ(cfx_of(robot, Q{0, 60 * d, -90 * d, 0, 30 * d, 0}), 2);
  EXPECT_EQ(cfx_of(robot, Q{-70 * d, 60 * d, -90 * d, 0, -30 * d, 200 * d}), 3);
  EXPECT_EQ(cfx_of(robot, Q{0, -80 * d, -60 * d, 0, 30 * d, 0}), 4);
  EXPECT_EQ(cfx_of(robot, Q{160 * d, -80 * d, -60 * d, 0, -30 * d, 0}), 5);
  EXPECT_EQ(cfx_of(robot, Q{0, -60 * d, -90 * d, 0, 30 * d, 0}), 6);
  EXPECT_EQ(cfx_of(robot, Q{0, -60 * d, -90 * d, 90 * d, -30 * d, 0}), 7);
  const double line = std::atan2(70, 302) - host::pi / 2;
  EXPECT_EQ(cfx_of(robot, Q{0, 60 * d, line + 0.01, 0, 30 * d, 0}), 0);
  EXPECT_EQ(cfx_of(robot, Q{0, 60 * d, line - 0.01, 0, 30 * d, 0}), 2);
  // On an edge both fit.
  const auto edge = arm_sides(robot.nominal, Q{0, 60 * d, line, 0, 0, 0});
  ASSERT_TRUE(edge);
  for (const int cfx : {0, 1, 2, 3}) EXPECT_TRUE(fits_cfx(*edge, cfx)) << cfx;
  for (const int cfx : {4, 5, 6, 7}) EXPECT_FALSE(fits_cfx(*edge, cfx)) << cfx;
}

TEST(ArmSides, GiveEachWayToAPoseItsOwn) {
  for (const char* name : {"abb-irb120", "kuka-kr6-r900"}) {
    const Robot robot = support::robot(name);
    const support::MovingArm nominal(robot);
    arms::Random random(4);
    std::size_t ways = 0;
    for (int n = 0; n < 15; ++n) {
      const Q q = random.pose(robot.nominal);
      if (std::abs(std::sin(q[4])) < 0.1) continue;
      std::map<int, Q> by_cfx;
      for (const Q& way : nominal_inverses(robot.nominal, nominal(q))) {
        const int cfx = cfx_of(robot, way);
        ASSERT_GE(cfx, 0) << name;
        const auto [at, first] = by_cfx.emplace(cfx, way);
        ways += first ? 1 : 0;
        // Those of one cfx are whole turns apart.
        for (std::size_t j = 0; j < joint_count; ++j)
          EXPECT_LT(std::abs(std::remainder(way[j] - at->second[j], 2 * host::pi)), 1e-5)
              << name << " cfx " << cfx;
      }
    }
    EXPECT_GT(ways, 30U) << name;
  }
}

TEST(ArmSides, AreNotThereWhereTheyCannotBeTold) {
  EXPECT_FALSE(arm_sides(support::robot("ur5").nominal, Q{0.1, -1, 1, 0.2, 0.3, 0.4}));
  // Straight up with all readings 0, which is on neither side.
  EXPECT_FALSE(arm_sides(support::robot("tx60l").nominal, Q{0.1, -1, 1, 0.2, 0.3, 0.4}));
}

}  // namespace
