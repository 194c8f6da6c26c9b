// SPDX-License-Identifier: Apache-2.0
// All ways of an arm to a pose: each way by which a random pose was made is among them, each of them reaches it, and an arm
// whose wrist axes meet has the eight (or fewer, by its limits) that geometry gives.
#include "kinematics/nominal_inverse.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <vector>

#include "flexcomp/forward.hpp"
#include "flexcomp/model.hpp"
#include "support/arms.hpp"
#include "support/robot_files.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;

TEST(NominalInverses, TheWayByWhichThePoseWasMadeIsAmongThem) {
  for (const char* name : {"kuka-kr6-r900", "abb-irb120", "tx60l", "rx160l", "ur5", "ur10"}) {
    const Robot robot = support::robot(name);
    Model<double, joint_count, Capacity<1, 1, 6>> model;
    model.begin(robot.nominal);
    model.finish();
    arms::Random random(1);
    int missed = 0;
    std::size_t ways = 0;
    constexpr int poses = 60;
    const auto start = std::chrono::steady_clock::now();
    for (int n = 0; n < poses; ++n) {
      std::array<double, joint_count> q{};
      for (std::size_t j = 0; j < joint_count; ++j) {
        const JointLimits& l = robot.nominal.limits[j];
        q[j] = (l.min_rad + l.max_rad) / 2 + random.around((l.max_rad - l.min_rad) / 2);
      }
      // At a singular wrist there is no end of ways.
      if (std::abs(std::sin(q[4])) < 0.1) continue;
      const Pose<double> pose = nominal_forward(model, q);
      const auto all = nominal_inverses(robot.nominal, pose);
      ways += all.size();
      const bool there = std::ranges::any_of(all, [&q](const auto& other) {
        double most = 0;
        for (std::size_t j = 0; j < joint_count; ++j) most = std::max(most, std::abs(q[j] - other[j]));
        return most < 1e-5;
      });
      missed += there ? 0 : 1;
      for (const auto& other : all) {
        const Pose<double> reached = nominal_forward(model, other);
        ASSERT_LT((reached.position - pose.position).norm(), 1e-10);
        ASSERT_LT((reached.rotation - pose.rotation).norm(), 1e-10);
        for (std::size_t j = 0; j < joint_count; ++j) {
          ASSERT_GE(other[j], robot.nominal.limits[j].min_rad);
          ASSERT_LE(other[j], robot.nominal.limits[j].max_rad);
        }
      }
    }
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
    std::printf("%s: %zu ways to %d poses, %d missed, %.1f ms each\n", name, ways, poses, missed,
                took.count() / poses);
    EXPECT_EQ(missed, 0) << name;
  }
}

}  // namespace
