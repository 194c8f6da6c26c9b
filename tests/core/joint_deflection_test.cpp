// SPDX-License-Identifier: Apache-2.0
// The kernels of the control cycle against the forward model: torques, moments and levers in the links' frames (C12),
// expanded curves, linearised deflections (C13), first-order twists (C3), chains whose links have moved; and what the
// correction leaves of every kind of term.
#include <flexcomp/compensate.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "support/arms.hpp"

namespace {

using arms::Joints;
using arms::part;
using flexcomp::Basis;
using flexcomp::Factor;
using flexcomp::Model;
namespace detail = flexcomp::detail;
namespace slot = flexcomp::slot;

std::array<flexcomp::SinCos<double>, 6> angles(const Model<double>& model, const Joints& q) {
  std::array<flexcomp::SinCos<double>, 6> a;
  for (std::size_t i = 0; i < 6; ++i) a[i] = compose(flexcomp::sin_cos(q[i]), model.shape(i).offset);
  return a;
}

/// Every kind of term that deflects joints by loads, also of other joints and of a curve times torque.
arms::TermSet<double> loaded_terms(const arms::Arm& arm, arms::Random& random) {
  arms::TermSet<double> set = arms::table1(arm);
  set.add(arms::on_load(slot::mass), Basis::one, 0.2);
  set.add(arms::on_load(slot::com_y), Basis::one, -0.01);
  set.add(arms::on_tool(slot::x), Basis::one, 0.002);
  for (std::size_t i = 0; i < 6; ++i) {
    set.add(arms::on_link(i + 1, slot::theta), Basis::load_torque_cubed, random.around(1e-7), i);
    set.add(arms::on_link((i + 2) % 6 + 1, slot::theta), Basis::load_torque, random.around(1e-5), i);
  }
  flexcomp::Term<double>& t = set.add(arms::on_link(3, slot::theta), Basis::curve, 1.0, 2);
  t.table = set.add_curve(random.around(1e-5, 24));
  t.factor = Factor::load_torque;
  return set;
}

Joints deflection_by_loads(const Model<double>& model, const Joints& q,
                           const flexcomp::Context<double, 6>& context) {
  detail::StaticLoad<double> load;
  detail::static_load(model, context, load);
  detail::LinkLoads<double, 6> loads;
  const auto angle = angles(model, q);
  detail::compute_loads(model, angle, load, loads);
  Joints deflection;
  detail::load_deflection(model, context, q, angle, load, loads, deflection);
  return deflection;
}

/// A term of every kind that moves links, base or tool.
void add_moves(arms::TermSet<double>& set, arms::Random& random, double size) {
  for (const std::size_t j : {std::size_t{1}, std::size_t{4}}) {
    set.add(arms::on_link(j + 1, slot::alpha), Basis::sine, random.around(size), j, 1);
    set.add(arms::on_link(j + 1, slot::gamma), Basis::cosine, random.around(size), j, 2);
    set.add(arms::on_link(j, slot::gamma), Basis::direction, random.around(size), j);
  }
  set.add(arms::on_link(2, slot::alpha), Basis::load_moment_x, random.around(0.02 * size), 1);
  set.add(arms::on_link(3, slot::beta), Basis::load_moment_y, random.around(0.02 * size), 2);
  set.add(arms::on_link(2, slot::a), Basis::thermal, 12e-6, 1);
  set.add(arms::on_link(4, slot::d), Basis::thermal, 12e-6, 3);
  set.add(arms::on_base(slot::rx), Basis::base_moment_x, random.around(0.02 * size), 0, -0.3);
  set.add(arms::on_base(slot::ry), Basis::base_moment_y, random.around(0.02 * size), 0, -0.3);
  set.add(arms::on_tool(slot::x), Basis::load_torque, random.around(0.01 * size), 1);
  set.add(arms::on_tool(slot::ry), Basis::sine, random.around(size), 5, 1);
  set.add_lever(arms::on_link(1, slot::d), random.around(size), 1, 3);
}

TEST(JointDeflection, MovesOfLinksMatchTheForwardModel) {
  arms::Random random(37);
  double worst = 0, largest = 0, pose = 0;
  for (const arms::Arm& arm : arms::all()) {
    arms::TermSet<double> set = arms::table1(arm);
    add_moves(set, random, 1e-3);
    const auto model = arms::prepared(arm.robot, set);
    for (int n = 0; n < 20000 / part; ++n) {
      const Joints q = random.pose(arm.robot);
      const flexcomp::Context<double, 6> context = arms::random_context(arm.robot, random);
      flexcomp::Workspace<double> ws;
      flexcomp::forward(model, q, context, ws);
      detail::StaticLoad<double> load;
      detail::static_load(model, context, load);
      detail::LinkLoads<double, 6> loads;
      auto angle = angles(model, q);
      detail::compute_loads(model, angle, load, loads);
      detail::MovedParts<double, 6> moved;
      detail::move_parts(model, context, q, angle, load, loads, moved);
      for (std::size_t i = 0; i < 6; ++i) {
        worst = std::max({worst, std::abs(moved.base[i] - model.base()[i] - ws.slots.base[i]),
                          std::abs(moved.tool[i] - model.tool()[i] - ws.slots.tool[i])});
        for (const double v : ws.slots.link[i]) largest = std::max(largest, std::abs(v));
      }
      // The chain with links moved, gamma as well, at the joint angles of the forward model.
      std::array<detail::JointAxis<double>, 6> joints;
      detail::FlangePose<double> flange;
      detail::rigid_pass(moved.links, ws.deflected, joints, flange);
      const flexcomp::Vector3<double>& origin = ws.frames.origin[6];
      pose = std::max(pose, std::abs(flange.origin.x - origin[0]) + std::abs(flange.origin.y - origin[1]) +
                                std::abs(flange.origin.z - origin[2]));
      pose = std::max(pose, std::abs(flange.axes.a.y - ws.frames.rotation[6](1, 0)) +
                                std::abs(flange.axes.b.z - ws.frames.rotation[6](2, 1)));
    }
  }
  std::printf(
      "[ measured ] slots up to %.1e; difference to the forward model: base and tool %.1e, chain %.1e m\n",
      largest, worst, pose);
  EXPECT_GT(largest, 1e-3);
  EXPECT_LE(worst, 1e-14);
  EXPECT_LE(pose, 1e-14);
}

TEST(JointDeflection, LoadsMatchTheForwardModel) {
  arms::Random random(31);
  double worst = 0, largest = 0;
  for (const arms::Arm& arm : arms::all()) {
    const arms::TermSet<double> set = loaded_terms(arm, random);
    const auto model = arms::prepared(arm.robot, set);
    for (int n = 0; n < 20000 / part; ++n) {
      const Joints q = random.pose(arm.robot);
      flexcomp::Context<double, 6> context = arms::random_context(arm.robot, random);
      if (n % 2 == 0) context.force_n = {0, 0, 0};
      flexcomp::Workspace<double> ws;
      flexcomp::forward(model, q, context, ws);
      detail::StaticLoad<double> load;
      detail::static_load(model, context, load);
      ASSERT_EQ(load.is_plain, n % 2 == 0);
      const Joints deflection = deflection_by_loads(model, q, context);
      for (std::size_t i = 0; i < 6; ++i) {
        worst = std::max(worst, std::abs(deflection[i] - ws.slots.link[i][slot::theta]));
        largest = std::max(largest, std::abs(deflection[i]));
      }
    }
  }
  std::printf("[ measured ] deflection up to %.1e rad, difference to the forward model %.1e rad\n", largest,
              worst);
  EXPECT_GT(largest, 1e-3);
  EXPECT_LE(worst, 1e-13);
}

TEST(JointDeflection, LinearisationMatchesValueAndDifferences) {
  arms::Random random(32);
  double worst = 0, worst_change = 0;
  for (const arms::Arm& arm : arms::all()) {
    arms::TermSet<double> set = arms::table1(arm);
    const auto model = arms::prepared(arm.robot, set);
    const flexcomp::Context<double, 6> context = flexcomp::default_context<double>(arm.robot);
    detail::StaticLoad<double> load;
    detail::static_load(model, context, load);
    ASSERT_TRUE(load.is_plain);
    for (int n = 0; n < 20000 / part; ++n) {
      const Joints q = random.pose(arm.robot);
      std::array<detail::JointAxis<double>, 6> joints;
      detail::FlangePose<double> flange;
      detail::rigid_pass(model.shapes(), angles(model, q), joints, flange);
      const Joints deflection = deflection_by_loads(model, q, context);
      Joints linearised, change;
      detail::LinearisedDeflection<double, 6> chain;
      chain.set(model, joints, flange, load, linearised);
      for (std::size_t i = 0; i < 6; ++i) worst = std::max(worst, std::abs(deflection[i] - linearised[i]));

      // Against differences. The linearisation leaves out joints between a lever's ends: joint 4 of the arm
      // with three parallel axes.
      Joints by, beyond = q, before = q;
      for (std::size_t i = 0; i < 6; ++i) {
        by[i] = i == 3 && arm.parallel_3 ? 0 : random.around(1e-4);
        beyond[i] += by[i];
        before[i] -= by[i];
      }
      chain.change(model, joints, by, change);
      const Joints ahead = deflection_by_loads(model, beyond, context);
      const Joints behind = deflection_by_loads(model, before, context);
      for (std::size_t i = 0; i < 6; ++i) {
        worst_change = std::max(worst_change, std::abs(0.5 * (ahead[i] - behind[i]) - change[i]));
      }
    }
  }
  std::printf("[ measured ] linearised to %.1e rad; for turns of 1e-4 rad the change to %.1e rad\n", worst,
              worst_change);
  EXPECT_LE(worst, 1e-13);
  EXPECT_LE(worst_change, 1e-9);  // 1e-4 rad times a slope of up to 1e-2 is 1e-6
}

TEST(JointDeflection, ExpandedCurveMatchesTheSpline) {
  arms::Random random(33);
  for (const std::size_t size : {6U, 7U, 18U, 128U, 256U}) {
    arms::TermSet<double> set;
    const std::vector<double> c = random.around(1, size);
    flexcomp::Term<double>& t = set.add(arms::on_link(1, slot::theta), Basis::curve, 1.0, 0);
    t.table = set.add_curve(c);
    const auto model = arms::prepared(arms::tx60l(), set);
    double value = 0, slope = 0, bend = 0;
    for (int n = 0; n < 20000 / part; ++n) {
      const double q = n < 100 ? (n - 50) * flexcomp::pi / 25 : random.around(30);
      detail::Expansion<double> at{0, 0, 0};
      detail::expand_curve(model, t, q, 1.0, at);
      const double h = 1e-4 / static_cast<double>(size);
      const double left = plain::curve(c, q - h), here = plain::curve(c, q), right = plain::curve(c, q + h);
      value = std::max(value, std::abs(at.value - here));
      const double m = static_cast<double>(size);
      slope = std::max(slope, std::abs(at.slope - (right - left) / (2 * h)) / m);
      bend = std::max(bend, std::abs(2 * at.half_curvature - (right - 2 * here + left) / (h * h)) / (m * m));
    }
    EXPECT_LE(value, 1e-12) << size;
    EXPECT_LE(slope, 1e-7) << size;
    EXPECT_LE(bend, 1e-4) << size;  // a cubic's second derivative has corners, and differences see both sides
  }
}

TEST(JointDeflection, ConstantTwistMatchesTheChain) {
  arms::Random random(34);
  for (const arms::Arm& arm : arms::all()) {
    arms::TermSet<double> set = arms::table1_geometry(arm, 0.01);
    for (std::uint8_t k = 0; k < 6; ++k) set.add(arms::on_tool(k), Basis::one, 1e-5);
    const auto model = arms::prepared(arm.robot, set);
    for (int n = 0; n < 2000 / part; ++n) {
      const Joints q = random.pose(arm.robot);
      const flexcomp::Pose<double> nominal = flexcomp::nominal_forward(model, q);
      const flexcomp::Pose<double> real =
          arms::forward(model, q, flexcomp::default_context<double>(arm.robot));
      std::array<flexcomp::SinCos<double>, 6> angle;
      for (std::size_t i = 0; i < 6; ++i)
        angle[i] = compose(flexcomp::sin_cos(q[i]), model.nominal(i).offset);
      flexcomp::SmallMotion<double> move;
      detail::constant_twist(model, angle, move);
      const flexcomp::SmallMotion<double>& base = model.plan().base_twist();
      const Eigen::Vector3d turn(move.angular.x + base.angular.x, move.angular.y + base.angular.y,
                                 move.angular.z + base.angular.z);
      const Eigen::Vector3d shift(move.linear.x + base.linear.x, move.linear.y + base.linear.y,
                                  move.linear.z + base.linear.z);
      const Eigen::Vector3d expected = real.position - nominal.position;
      ASSERT_LE((shift + turn.cross(nominal.position) - expected).norm(), 3e-9) << arm.name;
      const Eigen::Matrix3d r = real.rotation * nominal.rotation.transpose();
      const Eigen::Vector3d w(r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1));
      ASSERT_LE((turn - 0.5 * w).norm(), 3e-9) << arm.name;
    }
  }
}

/// Largest remaining position error over regular poses, m.
double left_by(const arms::Robot& robot, const Model<double>& model, arms::Random& random, bool with_force) {
  const arms::NominalJacobian jacobian(robot);
  double left = 0;
  for (int n = 0; n < 4000 / part;) {
    const Joints q = random.pose(robot);
    if (!jacobian.is_regular(q)) continue;
    ++n;
    flexcomp::Context<double, 6> context = flexcomp::default_context<double>(robot);
    for (double& d : context.direction) d = static_cast<double>(random.below(3)) - 1;
    context.temperature_c = random.uniform(10, 40);
    if (with_force) context.force_n = {random.around(20), random.around(20), random.around(20)};
    const flexcomp::Compensated<double, 6> r = flexcomp::compensate(model, q, context);
    if (r.status != flexcomp::StepStatus::ok) continue;
    left = std::max(left, flexcomp::target_residual(model, r.q, q, context).position_m);
  }
  return left;
}

TEST(JointDeflection, EveryTermOfJointsIsCompensated) {
  arms::Random random(35);
  for (const arms::Arm& arm : arms::all()) {
    arms::TermSet<double> set = arms::table1(arm);
    arms::add_joint_curves(set, random, 200e-6, 40);
    for (std::size_t i = 0; i < 6; ++i) {
      const flexcomp::Place own = arms::on_link(i + 1, slot::theta);
      set.add(own, Basis::sine, random.around(1e-4), i, 2);
      set.add(own, Basis::cosine, random.around(2e-5), i, 100);
      set.add(own, Basis::joint_position, random.around(2e-4), i);
      set.add(own, Basis::direction, random.around(1e-4), i);
      set.add(own, Basis::sine, random.around(1e-4), (i + 1) % 6, 1);
      set.add(own, Basis::joint_position, random.around(1e-4), (i + 5) % 6);
    }
    set.add(arms::on_tool(slot::rx), Basis::one, 1e-3);
    set.add(arms::on_tool(slot::z), Basis::one, -1e-3);
    const auto model = arms::prepared(arm.robot, set);
    for (const bool with_force : {false, true}) {
      const double left = left_by(arm.robot, model, random, with_force);
      std::printf("[ measured ] %s%s: %.1e m\n", arm.name, with_force ? ", force" : "", left);
      EXPECT_LE(left, 2e-9) << arm.name;
    }
  }
}

TEST(JointDeflection, MovesOfLinksBaseAndToolAreCompensated) {
  arms::Random random(36);
  for (const arms::Arm& arm : arms::all()) {
    arms::TermSet<double> set = arms::table1(arm);
    arms::add_joint_curves(set, random, 200e-6, 40);
    add_moves(set, random, 3e-4);
    const auto model = arms::prepared(arm.robot, set);
    for (const bool with_force : {false, true}) {
      const double left = left_by(arm.robot, model, random, with_force);
      std::printf("[ measured ] %s, links, base and tool%s: %.1e m\n", arm.name, with_force ? ", force" : "",
                  left);
      EXPECT_LE(left, 2e-9) << arm.name;
    }
  }
}

// 0.02 sin(100 q): nothing converges, and the step says so.
TEST(JointDeflection, WhatDoesNotConvergeIsNotOk) {
  const arms::Arm& arm = arms::all()[0];
  arms::Random random(38);
  arms::TermSet<double> set = arms::table1(arm);
  set.add(arms::on_link(2, slot::theta), Basis::sine, 0.02, 1, 100);
  const auto model = arms::prepared(arm.robot, set);
  const auto context = flexcomp::default_context<double>(arm.robot);
  int silent = 0, said = 0;
  for (int n = 0; n < 5000 / part; ++n) {
    const Joints q = random.pose(arm.robot);
    const flexcomp::Compensated<double, 6> r = flexcomp::compensate(model, q, context);
    if ((r.flags & flexcomp::step_flag::not_converged) != 0) ++said;
    if (r.status == flexcomp::StepStatus::ok &&
        flexcomp::target_residual(model, r.q, q, context).position_m > 1e-6)
      ++silent;
  }
  EXPECT_EQ(silent, 0);
  EXPECT_GT(said, 0);
}

// A harmonic at its inflection, onto which another one shifts it: neither slope nor curvature show that there is more.
TEST(JointDeflection, AnOwnHarmonicAtItsInflectionIsFound) {
  const arms::Robot robot = arms::tx60l();
  const auto context = flexcomp::default_context<double>(robot);
  struct Case {
    double first, order, size;
  };
  for (const Case c : {Case{5e-3, 101, 1e-4}, {0.01, 101, 2e-4}, {0.01, 300, 5e-4}, {0.018, 300, 3e-4}}) {
    arms::TermSet<double> set;
    set.add(arms::on_link(6, slot::theta), Basis::sine, c.first, 5, 1);
    set.add(arms::on_link(6, slot::theta), Basis::sine, c.size, 5, c.order);
    const auto model = arms::prepared(robot, set);
    Joints q = {0.3, 0.4, 1, 0.5, 0.8, 0.2};
    double worst = 0;
    int ok = 0;
    constexpr int count = 20000;
    for (int n = 0; n < count; ++n) {
      q[5] = 0.2 + 2 * flexcomp::pi / c.order * n / count;
      const auto r = flexcomp::compensate(model, q, context);
      if (r.status != flexcomp::StepStatus::ok) continue;
      ++ok;
      worst = std::max(worst, flexcomp::target_residual(model, r.q, q, context).orientation_rad);
    }
    EXPECT_EQ(ok, count);
    EXPECT_LE(worst, 1e-9) << c.order;
  }
}

// The first step of the fixed point may be small although the slope is not.
TEST(JointDeflection, SteepMovesOfLinksAreReachedWhereItSaysOk) {
  const arms::Robot robot = arms::tx60l();
  const auto context = flexcomp::default_context<double>(robot);
  arms::Random random(39);
  for (const double order : {10.0, 50.0}) {
    arms::TermSet<double> set;
    set.add(arms::on_link(4, slot::alpha), Basis::sine, 4e-3, 3, order);
    const auto model = arms::prepared(robot, set);
    double worst = 0, beyond = 0;
    for (int n = 0; n < 40000 / part; ++n) {
      const Joints q = random.pose(robot);
      const auto r = flexcomp::compensate(model, q, context);
      const auto left = flexcomp::target_residual(model, r.q, q, context);
      if (r.status == flexcomp::StepStatus::ok)
        worst = std::max({worst, left.position_m, left.orientation_rad});
      beyond = std::max(beyond, left.orientation_rad - 1.05 * r.remaining_orientation_rad);
    }
    std::printf("[ measured ] order %.0f: %.1e where ok; beyond what is said %.1e rad\n", order, worst,
                beyond);
    EXPECT_LE(worst, 1e-6) << order;
    EXPECT_LE(beyond, 2e-7) << order;
  }
}

}  // namespace
