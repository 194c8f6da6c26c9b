// SPDX-License-Identifier: Apache-2.0
// The rigid forward model and its Jacobian against KDL, which shares no code with the core.
#include <kdl/chain.hpp>
#include <kdl/chainjnttojacsolver.hpp>

#include <algorithm>
#include <cstdio>

#include <gtest/gtest.h>

#include "support/arms.hpp"
#include "support/drawn_arm.hpp"

namespace {

using arms::Joints;
using arms::Robot;
using flexcomp::Basis;

constexpr double bound = 1e-12;  // m and rad

/// Differences from nominal: six links with theta, d, a, alpha, beta, then base and tool x y z rx ry rz.
struct Errors {
  double link[6][5] = {};
  double base[6] = {};
  double tool[6] = {};
};

Errors random_errors(arms::Random& random) {
  Errors e;
  for (auto& link : e.link) {
    link[0] = random.around(2 * arms::deg);
    link[1] = random.around(20 * arms::mm);
    link[2] = random.around(20 * arms::mm);
    link[3] = random.around(2 * arms::deg);
    link[4] = random.around(2 * arms::deg);
  }
  for (double* part : {e.base, e.tool}) {
    for (int k = 0; k < 3; ++k) part[k] = random.around(20 * arms::mm);
    for (int k = 3; k < 6; ++k) part[k] = random.around(2 * arms::deg);
  }
  return e;
}

KDL::Frame small(const double (&v)[6]) {
  return KDL::Frame(KDL::Vector(v[0], v[1], v[2])) * KDL::Frame(KDL::Rotation::RotZ(v[5])) *
         KDL::Frame(KDL::Rotation::RotY(v[4])) * KDL::Frame(KDL::Rotation::RotX(v[3]));
}

KDL::Chain chain_of(const Robot& robot, const Errors& e) {
  KDL::Chain chain;
  chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::None), small(e.base)));
  for (std::size_t i = 0; i < 6; ++i) {
    const flexcomp::NominalLink& l = robot.links[i];
    chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::RotZ),
                                  KDL::Frame(KDL::Rotation::RotZ(l.theta_rad + e.link[i][0])) *
                                      KDL::Frame(KDL::Vector(0, 0, l.d_m + e.link[i][1])) *
                                      KDL::Frame(KDL::Vector(l.a_m + e.link[i][2], 0, 0)) *
                                      KDL::Frame(KDL::Rotation::RotX(l.alpha_rad + e.link[i][3])) *
                                      KDL::Frame(KDL::Rotation::RotY(l.beta_rad + e.link[i][4]))));
  }
  const KDL::Frame tool(KDL::Rotation::Quaternion(robot.tool_wxyz[1], robot.tool_wxyz[2], robot.tool_wxyz[3],
                                                  robot.tool_wxyz[0]),
                        KDL::Vector(robot.tool_xyz_m[0], robot.tool_xyz_m[1], robot.tool_xyz_m[2]));
  chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::None), tool * small(e.tool)));
  return chain;
}

arms::TermSet<double> error_terms(const Errors& e) {
  arms::TermSet<double> set;
  for (std::size_t i = 0; i < 6; ++i)
    for (std::uint8_t s = 0; s < 5; ++s) set.add(arms::on_link(i + 1, s), Basis::one, e.link[i][s]);
  for (std::uint8_t s = 0; s < 6; ++s) {
    set.add(arms::on_base(s), Basis::one, e.base[s]);
    set.add(arms::on_tool(s), Basis::one, e.tool[s]);
  }
  return set;
}

struct FromKdl {
  double position_m = 0;
  double orientation_rad = 0;
  double jacobian = 0;
};

/// Largest differences over `count` poses of one arm with the errors.
void compare(const Robot& robot, const Errors& errors, arms::Random& random, int count, FromKdl& worst) {
  const KDL::Chain chain = chain_of(robot, errors);
  drawn::Judge judge(chain);
  KDL::ChainJntToJacSolver jac(chain);
  const auto model = arms::prepared(robot, error_terms(errors));
  const auto context = flexcomp::default_context<double>(robot);
  for (int n = 0; n < count; ++n) {
    const Joints q = random.pose(robot);
    KDL::JntArray joints(6);
    for (unsigned i = 0; i < 6; ++i) joints(i) = q[i];
    KDL::Jacobian jacobian(6);
    ASSERT_GE(jac.JntToJac(joints, jacobian), 0);
    const flexcomp::Pose<double> expected = judge(q);

    const auto at = arms::linearised(model, q, context);
    const flexcomp::Pose<double> pose = arms::forward(model, q, context);
    ASSERT_EQ(pose.position, at.pose.position);
    ASSERT_EQ(pose.rotation, at.pose.rotation);
    worst.position_m = std::max(worst.position_m, (pose.position - expected.position).norm());
    worst.orientation_rad =
        std::max(worst.orientation_rad, arms::angle_between(expected.rotation, pose.rotation));
    for (std::size_t i = 0; i < 6; ++i) {
      const auto screw = flexcomp::screw(model, at, arms::on_link(i + 1, flexcomp::slot::theta));
      worst.jacobian =
          std::max(worst.jacobian, (screw - jacobian.data.col(static_cast<int>(i))).cwiseAbs().maxCoeff());
    }
  }
}

void report(const char* what, const char* arm, const FromKdl& worst) {
  std::printf("[ measured ] %s, %s: %.1e m, %.1e rad, Jacobian %.1e\n", arm, what, worst.position_m,
              worst.orientation_rad, worst.jacobian);
  EXPECT_LE(worst.position_m, bound) << arm;
  EXPECT_LE(worst.orientation_rad, bound) << arm;
  EXPECT_LE(worst.jacobian, bound) << arm;
}

TEST(Kdl, NominalArm) {
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(1);
    FromKdl worst;
    compare(arm.robot, Errors(), random, 10000, worst);
    report("nominal", arm.name, worst);
  }
}

TEST(Kdl, NominalForwardIsTheSameChain) {
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(2);
    const auto model = arms::prepared(arm.robot, arms::TermSet<double>());
    drawn::Judge judge(chain_of(arm.robot, Errors()));
    for (int n = 0; n < 1000; ++n) {
      const Joints q = random.pose(arm.robot);
      const flexcomp::Pose<double> expected = judge(q);
      const flexcomp::Pose<double> pose = flexcomp::nominal_forward(model, q);
      for (int r = 0; r < 3; ++r) {
        ASSERT_NEAR(pose.position[r], expected.position[r], bound);
        for (int c = 0; c < 3; ++c) ASSERT_NEAR(pose.rotation(r, c), expected.rotation(r, c), bound);
      }
    }
  }
}

TEST(Kdl, RandomGeometricBaseAndToolErrors) {
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(3);
    FromKdl worst;
    // Other errors every 50 poses: 200 arms of each kind.
    for (int n = 0; n < 10000 / 50; ++n) compare(arm.robot, random_errors(random), random, 50, worst);
    report("20 mm and 2 deg of error in all 42 slots", arm.name, worst);
  }
}

TEST(Kdl, NominalBetaAndTheta) {
  // No arm here has a nominal beta, so one is made: a drawing may.
  arms::Random random(4);
  FromKdl worst;
  for (int n = 0; n < 100; ++n) {
    Robot robot = arms::rx160l();
    for (flexcomp::NominalLink& l : robot.links) {
      l.theta_rad = random.around(3);
      l.alpha_rad = random.around(3);
      l.beta_rad = random.around(1.5);
    }
    compare(robot, n % 2 == 0 ? Errors() : random_errors(random), random, 20, worst);
  }
  report("random nominal angles", "RX160L", worst);
}

}  // namespace
