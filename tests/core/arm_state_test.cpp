// SPDX-License-Identifier: Apache-2.0
// The way back and the rate of the step: round trips, differences, the forward model.
#include <flexcomp/arm_state.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include <gtest/gtest.h>

#include "support/random_terms.hpp"

namespace {

using arms::Joints;
using arms::part;
using flexcomp::Basis;
namespace slot = flexcomp::slot;

constexpr flexcomp::CompensationSettings<double> defaults;

/// Table 1, curves, and effects that move links and base.
arms::TermSet<double> every_kind(const arms::Arm& arm, arms::Random& random) {
  arms::TermSet<double> set = arms::table1(arm);
  arms::add_joint_curves(set, random, 200e-6);
  set.add(arms::on_link(3, slot::theta), Basis::load_torque_cubed, 1e-8, 2);
  set.add(arms::on_link(6, slot::theta), Basis::joint_position, 1e-4, 4);
  set.add(arms::on_link(2, slot::alpha), Basis::load_moment_x, 2e-6, 1);
  set.add(arms::on_link(5, slot::gamma), Basis::sine, 2e-4, 4, 1);
  set.add(arms::on_base(slot::rx), Basis::base_moment_x, 1e-6, 0, -0.3);
  set.add(arms::on_tool(slot::ry), Basis::cosine, 1e-4, 5, 1);
  return set;
}

TEST(ArmState, UncorrectUndoesTheStepAtRegularPoses) {
  arms::Random random(51);
  for (const arms::Arm& arm : arms::all()) {
    const arms::TermSet<double> set = every_kind(arm, random);
    const auto model = arms::prepared(arm.robot, set);
    const auto single = arms::prepared(arm.robot, arms::as<float>(set));
    const arms::NominalJacobian jacobian(arm.robot);
    double worst = 0;
    float worst_single = 0;
    int trips = 0, refused = 0;
    for (int n = 0; n < 4000 / part; ++n) {
      const Joints q = random.pose(arm.robot);
      const flexcomp::Context<double, 6> context = arms::random_context(arm.robot, random);
      const auto out = flexcomp::compensate(model, q, context);
      if (!jacobian.is_regular(q) || out.flags != 0) continue;
      ++trips;
      Joints back;
      if (!flexcomp::uncorrect(model, out.q, context, defaults, back)) {
        ++refused;  // so close to a limit that the iteration ends on it
        continue;
      }
      for (std::size_t i = 0; i < 6; ++i) worst = std::max(worst, std::abs(back[i] - q[i]));
      const auto rough = flexcomp::compensate(single, arms::as<float>(q), arms::as<float>(context));
      std::array<float, 6> back_single;
      if (rough.flags != 0) continue;
      ASSERT_TRUE(flexcomp::uncorrect(single, rough.q, arms::as<float>(context), {}, back_single));
      for (std::size_t i = 0; i < 6; ++i)
        worst_single = std::max(worst_single, std::abs(back_single[i] - static_cast<float>(q[i])));
    }
    std::printf("[ measured ] %s, %d round trips: %.1e rad, float %.1e rad\n", arm.name, trips, worst,
                static_cast<double>(worst_single));
    EXPECT_GT(trips, 1000 / part);
    EXPECT_LE(refused, 1 + trips / 500);
    EXPECT_LE(worst, 1e-9);
    EXPECT_LE(worst_single, 1e-5F);
  }
}

TEST(ArmState, UncorrectRefusesWhatNoCommandLeadsTo) {
  const arms::Arm& arm = arms::all()[0];
  const auto model = arms::prepared(arm.robot, arms::table1(arm));
  const auto context = flexcomp::default_context<double>(arm.robot);
  Joints q{0.1, 0.2, 0.3, 0.4, 0.5, 0.6}, back;
  EXPECT_TRUE(flexcomp::uncorrect(model, q, context, defaults, back));
  q[2] = std::nan("");
  EXPECT_FALSE(flexcomp::uncorrect(model, q, context, defaults, back));
  q[2] = 10;
  EXPECT_FALSE(flexcomp::uncorrect(model, q, context, defaults, back));
}

// (C22) against differences of the step, with loads, curves, moves of links and base, and forces.
TEST(ArmState, RateIsTheDerivativeOfTheStep) {
  arms::Random random(52);
  for (const arms::Arm& arm : arms::all()) {
    const arms::TermSet<double> set = every_kind(arm, random);
    const auto model = arms::prepared(arm.robot, set);
    const arms::NominalJacobian jacobian(arm.robot);
    double worst = 0, correction = 0;
    int poses = 0;
    for (int n = 0; n < 4000 / part; ++n) {
      const Joints q = random.pose(arm.robot), rate = random.joints(2);
      if (!jacobian.is_regular(q)) continue;
      flexcomp::Context<double, 6> context = arms::random_context(arm.robot, random);
      if (n % 2 == 0) context.force_n = {0, 0, 0};
      Joints corrected;
      flexcomp::Compensated<double, 6> out;
      if (!flexcomp::compensate_rate(model, q, rate, context, defaults, out, corrected)) continue;
      // Fourth-order differences: what the step leaves, 1e-9 rad, asks for a step that is too long for second order.
      constexpr double h = 5e-4;
      unsigned flags = out.flags;
      Joints difference{};
      for (const auto& [steps, weight] : {std::pair{-2, 1.0}, {-1, -8.0}, {1, 8.0}, {2, -1.0}}) {
        Joints moved;
        for (std::size_t i = 0; i < 6; ++i) moved[i] = q[i] + steps * h * rate[i];
        const auto at = flexcomp::compensate(model, moved, context);
        flags |= at.flags;
        for (std::size_t i = 0; i < 6; ++i) difference[i] += weight * at.q[i] / (12 * h);
      }
      if (flags != 0) continue;
      ++poses;
      double error = 0, size = 0, by = 0;
      for (std::size_t i = 0; i < 6; ++i) {
        error += std::pow(difference[i] - corrected[i], 2);
        by += std::pow(difference[i] - rate[i], 2);
        size += difference[i] * difference[i];
      }
      worst = std::max(worst, std::sqrt(error / size));
      correction = std::max(correction, std::sqrt(by / size));
    }
    std::printf(
        "[ measured ] %s, %d poses: rate off by %.1e of itself (the correction is up to %.1e of it)\n",
        arm.name, poses, worst, correction);
    EXPECT_GT(poses, 1000 / part);
    EXPECT_GT(correction, 1e-2);
    EXPECT_LE(worst, 1e-6);
  }
}

// Where links move so fast with the joints that the rounds do not end, nothing is passed off as the derivative.
TEST(ArmState, ARateThatDoesNotConvergeIsNotGiven) {
  const arms::Robot robot = arms::tx60l();
  arms::TermSet<double> set;
  set.add(arms::on_link(4, slot::alpha), Basis::sine, 2e-3, 3, 100);
  const auto model = arms::prepared(robot, set);
  const auto context = flexcomp::default_context<double>(robot);
  arms::Random random(53);
  int given = 0, refused = 0;
  double worst = 0;
  for (int n = 0; n < 20000 / part; ++n) {
    const Joints q = random.pose(robot), rate = random.joints(1);
    Joints corrected;
    flexcomp::Compensated<double, 6> out;
    if (!flexcomp::compensate_rate(model, q, rate, context, defaults, out, corrected)) {
      if (out.flags == 0) {
        ++refused;
        EXPECT_EQ(corrected, rate);
      }
      continue;
    }
    constexpr double h = 1e-6;
    Joints ahead = q, behind = q;
    for (std::size_t i = 0; i < 6; ++i) ahead[i] += h * rate[i], behind[i] -= h * rate[i];
    const auto to = flexcomp::compensate(model, ahead, context),
               from = flexcomp::compensate(model, behind, context);
    if ((to.flags | from.flags) != 0) continue;
    ++given;
    double error = 0, size = 0;
    for (std::size_t i = 0; i < 6; ++i) {
      const double d = (to.q[i] - from.q[i]) / (2 * h);
      error += (d - corrected[i]) * (d - corrected[i]);
      size += d * d;
    }
    worst = std::max(worst, std::sqrt(error / size));
  }
  std::printf("[ measured ] %d given, off by %.1e at most; %d not given\n", given, worst, refused);
  EXPECT_GT(given, 0);
  EXPECT_GT(refused, 0);
  // The differences of the effects along 0.3 mrad are coarse for such a wave.
  EXPECT_LE(worst, 1e-3);
}

TEST(ArmState, RateOfAStepThatIsHeldBackIsTheCommands) {
  const arms::Arm& arm = arms::all()[0];
  const auto model = arms::prepared(arm.robot, arms::table1(arm));
  const auto context = flexcomp::default_context<double>(arm.robot);
  const Joints rate{1, 2, 3, 4, 5, 6};
  Joints corrected;
  flexcomp::Compensated<double, 6> out;
  const Joints at_the_wrist{0.1, 0.2, 0.3, 0.4, 0, 0.6};
  EXPECT_FALSE(flexcomp::compensate_rate(model, at_the_wrist, rate, context, defaults, out, corrected));
  EXPECT_NE(out.flags, 0);
  EXPECT_EQ(corrected, rate);
}

TEST(ArmState, RemainingErrorIsTheForwardModels) {
  arms::Random random(54);
  double worst = 0;
  for (const arms::Arm& arm : arms::all()) {
    const auto model = arms::prepared(arm.robot, every_kind(arm, random));
    for (int n = 0; n < 2000 / part; ++n) {
      const Joints command = random.pose(arm.robot);
      Joints q = command;
      const double size = n % 3 == 0 ? 0 : n % 3 == 1 ? 0.01 : 3;
      for (double& v : q) v += random.around(size);
      const flexcomp::Context<double, 6> context = arms::random_context(arm.robot, random);
      const auto left = flexcomp::remaining_error(model, q, command, context);
      const auto expected = flexcomp::target_residual(model, q, command, context);
      worst = std::max({worst, std::abs(left.position_m - expected.position_m),
                        std::abs(left.orientation_rad - expected.orientation_rad)});
    }
  }
  std::printf("[ measured ] remaining error to %.1e m, rad\n", worst);
  EXPECT_LE(worst, 1e-10);
}

TEST(ArmState, LoadsAndDeflectionsAreTheForwardModels) {
  arms::Random random(53);
  double worst = 0, worst_torque = 0;
  for (const arms::Arm& arm : arms::all()) {
    const arms::TermSet<double> set = every_kind(arm, random);
    const auto model = arms::prepared(arm.robot, set);
    for (int n = 0; n < 2000 / part; ++n) {
      const Joints q = random.pose(arm.robot);
      const flexcomp::Context<double, 6> context = arms::random_context(arm.robot, random);
      const flexcomp::JointLoads<double, 6> loads = flexcomp::joint_loads(model, q, context);
      flexcomp::Workspace<double> ws;
      flexcomp::forward(model, q, context, ws);
      flexcomp::Term<double> torque;
      torque.basis = Basis::load_torque;
      flexcomp::detail::unloaded_pass(model, ws);
      for (std::size_t i = 0; i < 6; ++i) {
        worst = std::max(worst, std::abs(loads.deflection_rad[i] - ws.slots.link[i][slot::theta]));
        torque.joint = static_cast<std::uint8_t>(i);
        worst_torque =
            std::max(worst_torque, std::abs(loads.torque_nm[i] - basis_value(model, torque, context, ws)));
      }
    }
  }
  std::printf("[ measured ] deflection to %.1e rad, torque to %.1e N m\n", worst, worst_torque);
  EXPECT_LE(worst, 1e-13);
  EXPECT_LE(worst_torque, 1e-11);
}

}  // namespace
