// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <limits>

#include "flexcomp_firmware/arithmetic.hpp"

#include "firmware/bench.hpp"

namespace flexcomp::firmware::bench {
namespace {

using wire::Answer;
using wire::Command;

Joints some_pose(std::mt19937& random, double reach = 1.0) {
  std::uniform_real_distribution<double> unit(-reach, reach);
  Joints q;
  for (auto& v : q) v = real(unit(random));
  return q;
}

wire::ProbeRequest request(const Joints& q, const FirmwareContext& c) {
  wire::ProbeRequest r;
  for (std::size_t j = 0; j < joints; ++j) {
    r.q_rad[j] = to_binary64_bits(q[j]);
    r.direction[j] = to_binary64_bits(c.direction[j]);
    r.relative_speed[j] = to_binary64_bits(c.relative_speed[j]);
  }
  r.payload_kg = to_binary64_bits(c.payload_kg);
  for (std::size_t k = 0; k < 3; ++k) {
    r.payload_com_m[k] = to_binary64_bits(c.payload_com_m[k]);
    r.force_n[k] = to_binary64_bits(c.force_n[k]);
  }
  r.temperature_c = to_binary64_bits(c.temperature_c);
  r.time_s = to_binary64_bits(c.time_s);
  return r;
}

TEST(Probe, EqualsTheCoreToTheLastBit) {
  Arm arm;
  const Bytes image = make_image(arm.robot, 3);
  ASSERT_EQ(arm.push(image), Answer::accepted);
  std::mt19937 random(1);
  for (int k = 0; k < 1000; ++k) {
    const Joints q = some_pose(random, 2.3);  // some of them beyond the limits
    FirmwareContext c = default_context<Scalar>(arm.robot);
    c.payload_kg = real(0.1 * k);
    c.force_n = {real(k), real(-k), 1};
    for (std::size_t j = 0; j < joints; ++j) c.direction[j] = (k >> j & 1) != 0 ? Scalar(1) : Scalar(-1);
    const Compensated<Scalar, joints> expected = by_the_core(arm.robot, image, q, c);
    const wire::ProbeResponse r = arm.device->probe(request(q, c));
    ASSERT_EQ(r.status, static_cast<std::uint16_t>(expected.status));
    ASSERT_EQ(r.flags, expected.flags);
    ASSERT_EQ(r.sequence, 3U);
    for (std::size_t j = 0; j < joints; ++j) ASSERT_EQ(r.q_rad[j], to_binary64_bits(expected.q[j]));
  }
}

TEST(Probe, SaysWhatItCannotDo) {
  Arm arm;
  const Joints q{};
  FirmwareContext c = default_context<Scalar>(arm.robot);
  const wire::ProbeResponse without = arm.device->probe(request(q, c));
  EXPECT_EQ(without.status, static_cast<std::uint16_t>(StepStatus::no_set));
  EXPECT_EQ(without.flags, step_flag::no_set);
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), Answer::accepted);
  wire::ProbeRequest r = request(q, c);
  r.q_rad[2] = 0x7FF8000000000001ULL;
  const wire::ProbeResponse out = arm.device->probe(r);
  EXPECT_EQ(out.status, static_cast<std::uint16_t>(StepStatus::refused));
  EXPECT_EQ(out.flags, step_flag::refused);
  EXPECT_EQ(out.q_rad, r.q_rad);
  EXPECT_EQ(out.position_m, 0U);
  r = request(q, c);
  r.payload_kg = 0x7FF0000000000000ULL;
  EXPECT_EQ(arm.device->probe(r).status, static_cast<std::uint16_t>(StepStatus::refused));
}

TEST(Step, EqualsTheCoreOnceSettled) {
  Arm arm(following_at_once());
  const Bytes image = make_image(arm.robot, 1);
  ASSERT_EQ(arm.push(image), Answer::accepted);
  std::mt19937 random(2);
  for (int k = 0; k < 100; ++k) {
    const Joints q = some_pose(random);
    const StepResult r = arm.step(q);
    FirmwareContext c = default_context<Scalar>(arm.robot);
    for (std::size_t j = 0; j < joints; ++j) c.direction[j] = arm.device->cycle().direction(j);
    const Compensated<Scalar, joints> expected = by_the_core(arm.robot, image, q, c);
    ASSERT_EQ(r.status, expected.status);
    ASSERT_EQ(r.flags, expected.flags);
    ASSERT_EQ(r.q, expected.q);
  }
}

// However sets come and go (pushed, rolled back, on trial and reverted, restored, one in the middle of
// another's settling), a standing arm moves within the offset's rate and acceleration.
TEST(Step, AChangeOfSetNeverMakesTheCommandJump) {
  Arm arm;
  std::mt19937 random(4);
  Joints q{};
  std::vector<Bytes> images;
  for (std::uint32_t n = 1; n <= 20; ++n) images.push_back(make_image(arm.robot, n, 1 + n % 5, n));
  std::uint32_t next = 0;
  Joints last{};
  Joints last_move{};
  double largest_correction = 0;
  double fastest = 0;
  double hardest = 0;
  for (int k = 0; k < 20000; ++k) {
    if (k % 37 == 0) {
      if (arm.device->status().state == 0 && next < 20) arm.stage(images[next]);
      const int what = static_cast<int>(random() % 4);
      if (what < 2 && arm.run(Command::commit) == Answer::accepted) ++next;
      if (what == 2 &&
          arm.run(Command::commit_trial, static_cast<std::uint32_t>(30 + k % 50)) == Answer::accepted)
        ++next;
      if (what == 3) arm.run(Command::rollback);
      if (k % 370 == 0) arm.run(Command::abort), arm.run(Command::restore_defaults);
      if (next == 20) arm.run(Command::restore_defaults), next = 0;
    }
    arm.device->store().poll(++arm.now_ms);
    // The command stands still, so all that moves is the change of set.
    const StepResult r = arm.step(q);
    Joints move;
    for (std::size_t j = 0; j < joints; ++j) {
      const Scalar correction = r.q[j] - q[j];
      move[j] = correction - last[j];
      last[j] = correction;
    }
    largest_correction = std::max(largest_correction, distance(last, {}));
    fastest = std::max(fastest, distance(move, {}));
    hardest = std::max(hardest, distance(move, last_move));
    last_move = move;
  }
  EXPECT_GT(largest_correction, 1e-4);
  EXPECT_GT(fastest, 0);
  EXPECT_LE(fastest, 0.5 * 1e-3 * (1 + 1e-9));
  EXPECT_LE(hardest, 20 * 1e-6 * (1 + 1e-9));
}

/// An arm that has just been switched on, with a set in its memory.
class PoweredUp : public testing::Test {
 protected:
  PoweredUp() {
    Arm(flash).push(make_image(tx60l(), 1));
    device = std::make_unique<Device>(tx60l(), flash.hooks(), DeviceSettings{});
    device->store().boot();
  }
  StepResult step(const Joints& q) { return device->step(q, default_context<Scalar>(tx60l())); }

  Flash flash;
  std::unique_ptr<Device> device;
};

TEST_F(PoweredUp, TheFirstOutputIsTheFirstCommand) {
  const Joints q = some_joints();
  StepResult r = step(q);
  EXPECT_EQ(r.q, q);
  // All the way to the corrected command the status says that it is not reached yet.
  Joints last = q;
  int cycles = 0;
  for (; r.status != StepStatus::ok && cycles < 1000; ++cycles) {
    EXPECT_EQ(r.status, StepStatus::limited);
    EXPECT_EQ(r.flags, step_flag::settling);
    r = step(q);
    EXPECT_LE(distance(r.q, last), 0.5e-3 * (1 + 1e-9));
    last = r.q;
  }
  EXPECT_GT(cycles, 5);
  EXPECT_LT(cycles, 100);
  EXPECT_EQ(r.flags, 0);
  EXPECT_NE(r.q, q);
  EXPECT_EQ(step(q).q, r.q) << "where it has settled it stands";
}

// The finding: after each power-up a standing arm moved by its whole correction.
TEST_F(PoweredUp, AStandingArmStaysWhereItStands) {
  const Joints q = some_joints();
  StepResult r = step(q);
  for (int k = 0; k < 100; ++k) r = step(q);
  const Joints standing = r.q;
  ASSERT_NE(standing, q);

  device = std::make_unique<Device>(tx60l(), flash.hooks(), DeviceSettings{});
  device->store().boot();
  ASSERT_TRUE(device->start(standing));
  r = step(q);
  EXPECT_EQ(r.q, standing);
  for (int k = 0; k < 100; ++k) {
    r = step(q);
    EXPECT_LE(distance(r.q, standing), 1e-15);
  }
  EXPECT_EQ(r.status, StepStatus::ok);
}

TEST_F(PoweredUp, ACommandFarFromWhereTheArmStandsIsRefused) {
  Joints standing = some_joints();
  ASSERT_TRUE(device->start(standing));
  Joints q = standing;
  q[2] += real(0.101);
  for (int k = 0; k < 10; ++k) {
    const StepResult r = step(q);
    EXPECT_EQ(r.q, standing);
    EXPECT_EQ(r.status, StepStatus::refused);
    EXPECT_NE(r.flags & step_flag::refused, 0);
  }
  q[2] -= real(0.002);
  StepResult r = step(q);
  EXPECT_EQ(r.q, standing);
  EXPECT_EQ(r.status, StepStatus::limited);
  for (int k = 0; k < 1000 && r.status != StepStatus::ok; ++k) r = step(q);
  EXPECT_EQ(r.status, StepStatus::ok);

  // What cannot be the place where an arm stands changes nothing.
  standing[1] = std::numeric_limits<Scalar>::quiet_NaN();
  EXPECT_FALSE(device->start(standing));
  standing[1] = real(2.3);
  EXPECT_FALSE(device->start(standing));
  EXPECT_EQ(step(q).status, StepStatus::ok);
}

// Without a place where it stands the first commands that are refused go out as far as they are finite.
TEST_F(PoweredUp, NothingThatIsNotFiniteGoesOutBeforeTheFirstCommand) {
  Joints q = some_joints();
  q[4] = std::numeric_limits<Scalar>::quiet_NaN();
  StepResult r = step(q);
  EXPECT_EQ(r.status, StepStatus::refused);
  for (std::size_t j = 0; j < joints; ++j) EXPECT_EQ(r.q[j], j == 4 ? Scalar(0) : q[j]);
  q[4] = real(2.5);  // beyond its limit, where an arm may well stand
  r = step(q);
  EXPECT_EQ(r.status, StepStatus::refused);
  EXPECT_EQ(r.q, q);
  q[4] = std::numeric_limits<Scalar>::infinity();
  EXPECT_EQ(step(q).q[4], real(2.5));
  q[4] = real(2.1);
  r = step(q);
  EXPECT_EQ(r.q, q);
  EXPECT_EQ(r.status, StepStatus::limited);
}

class OnRefusalTest : public testing::TestWithParam<OnRefusal> {
 protected:
  OnRefusalTest() : arm(with(GetParam())) { arm.push(make_image(arm.robot, 1, 20)); }
  static DeviceSettings with(OnRefusal how) {
    DeviceSettings settings;
    settings.control.on_refusal = how;
    return settings;
  }
  StepResult settled(const Joints& q) {
    StepResult r = arm.step(q);
    for (int k = 0; k < 2000 && r.status != StepStatus::ok; ++k) r = arm.step(q);
    return r;
  }
  bool holds() const { return GetParam() == OnRefusal::hold; }

  Arm arm;
};

// The finding: one NaN made the other five joints jump by the whole correction, and went out to the drive.
TEST_P(OnRefusalTest, ACommandWithANaNMovesNothing) {
  const Joints q = some_joints();
  const StepResult good = settled(q);
  ASSERT_EQ(good.status, StepStatus::ok);
  ASSERT_GT(distance(good.q, q), 1e-3);
  for (const Scalar bad : {std::numeric_limits<Scalar>::quiet_NaN(), std::numeric_limits<Scalar>::infinity(),
                           -std::numeric_limits<Scalar>::infinity()}) {
    Joints broken = q;
    broken[3] = bad;
    StepResult r = arm.step(broken);
    EXPECT_EQ(r.status, StepStatus::refused);
    EXPECT_EQ(r.flags, step_flag::refused);
    EXPECT_EQ(r.q, good.q);
    r = arm.step(q);
    EXPECT_EQ(r.q, good.q) << "the first command after it is reached from where the arm stands";
    r = settled(q);
    EXPECT_EQ(r.status, StepStatus::ok);
    EXPECT_EQ(r.q, good.q) << "a command that is not finite leaves no trace";
  }
}

// While the arm moves on, too: held for a cycle or for a hundred, it catches up within the offset's bounds.
TEST_P(OnRefusalTest, AnArmCatchesUpWithoutAJump) {
  Joints q = some_joints();
  settled(q);
  for (const int cycles : {1, 3, 100}) {
    const auto move = [&q] {
      q[0] += real(0.5e-3);
      q[1] -= real(0.2e-3);
    };
    Joints last = arm.step(q).q;
    for (int k = 0; k < cycles; ++k) {
      move();
      Joints broken = q;
      broken[2] = std::numeric_limits<Scalar>::quiet_NaN();
      EXPECT_EQ(arm.step(broken).q, last);
    }
    StepResult r{};
    for (int k = 0; k < 1000 && r.status != StepStatus::ok; ++k) {
      move();
      r = arm.step(q);
      if (k == 0) {
        EXPECT_EQ(r.q, last);
      }
      // Its own motion, the offset's, and what the correction changes on the way.
      EXPECT_LE(distance(r.q, last), 0.5e-3 + 0.5e-3 + 0.1e-3) << cycles << " " << k;
      last = r.q;
    }
    EXPECT_EQ(r.status, StepStatus::ok);
  }
}

TEST_P(OnRefusalTest, AContextThatIsNotFinite) {
  const Joints q = some_joints();
  const StepResult good = settled(q);
  FirmwareContext c = default_context<Scalar>(arm.robot);
  c.payload_kg = std::numeric_limits<Scalar>::quiet_NaN();
  Joints last = good.q;
  for (int k = 0; k < 200; ++k) {
    const StepResult r = arm.device->step(q, c);
    EXPECT_EQ(r.status, StepStatus::refused);
    EXPECT_LE(distance(r.q, last), holds() ? 0 : 0.5e-3 * (1 + 1e-9));
    last = r.q;
  }
  EXPECT_EQ(last, holds() ? good.q : q);
  StepResult r{};
  for (int k = 0; k < 200; ++k) {
    r = arm.step(q);
    EXPECT_LE(distance(r.q, last), 0.5e-3 * (1 + 1e-9));
    last = r.q;
  }
  EXPECT_EQ(r.q, good.q);
  EXPECT_EQ(r.status, StepStatus::ok);
}

TEST_P(OnRefusalTest, ACommandBeyondALimitIsHeldAlsoWithoutASet) {
  for (const bool with_set : {true, false}) {
    if (!with_set) {
      ASSERT_EQ(arm.run(Command::restore_defaults), Answer::accepted);
      arm.settle();
    }
    Joints q = some_joints();
    StepResult good = settled(q);
    for (int k = 0; k < 1000; ++k) good = arm.step(q);
    q[0] = real(2.3);
    const StepResult r = arm.step(q);
    EXPECT_EQ(r.status, StepStatus::refused);
    EXPECT_EQ(r.q, good.q);
    EXPECT_EQ(r.flags, step_flag::refused | (with_set ? 0 : step_flag::no_set));
  }
}

INSTANTIATE_TEST_SUITE_P(Both, OnRefusalTest, testing::Values(OnRefusal::pass_through, OnRefusal::hold));

// The finding: a payload of 0, then 4 kg, moved the command by 4 mrad in one cycle, a force of 500 N by 0.9
// mrad.
TEST(Step, AJumpOfTheLoadIsFollowedWithinTheBounds) {
  Arm arm;
  ASSERT_EQ(arm.push(make_image(arm.robot, 1, 10)), Answer::accepted);
  const Joints q = some_joints();
  FirmwareContext c = default_context<Scalar>(arm.robot);
  Joints position{};
  for (int k = 0; k < 500; ++k) position = arm.device->step(q, c).q;
  const auto check = [&](const char* what, double least) {
    const Joints before = position;
    Joints last_move{};
    StepResult r{};
    for (int k = 0; k < 500; ++k) {
      r = arm.device->step(q, c);
      if (k == 0) {
        EXPECT_EQ(r.status, StepStatus::limited) << what;
        EXPECT_EQ(r.flags, step_flag::settling) << what;
      }
      Joints move;
      for (std::size_t j = 0; j < joints; ++j) move[j] = r.q[j] - position[j];
      EXPECT_LE(distance(move, {}), 0.5e-3 * (1 + 1e-9)) << what << " " << k;
      EXPECT_LE(distance(move, last_move), 20e-6 * (1 + 1e-9)) << what << " " << k;
      position = r.q;
      last_move = move;
    }
    EXPECT_EQ(r.status, StepStatus::ok) << what;
    EXPECT_GT(distance(r.q, before), least) << what;
  };
  c.payload_kg += 4;
  check("payload", 1e-3);
  c.force_n = {0, 0, 500};
  check("force", 1e-3);
  c.payload_com_m[2] += real(0.3);
  check("centre of mass", 1e-4);
}

// What changes little from cycle to cycle, as the reading of a force sensor does, is followed without delay.
// What the output stage holds back belongs to what remains.
TEST(Step, WhatRemainsWhileItSettlesIsSaid) {
  Arm arm;
  const Bytes image = make_image(arm.robot, 1, 10);
  ASSERT_EQ(arm.push(image), Answer::accepted);
  auto model = std::make_unique<FirmwareModel>();
  ASSERT_EQ(model_from_image(image.data(), image.size(), arm.robot, *model), Refusal::none);
  FirmwareContext context = default_context<Scalar>(arm.robot);
  const Joints q = {real(0.1), real(0.4), real(-0.5), real(0.3), real(0.9), real(0.2)};
  int held_back = 0;
  Scalar greatest = Scalar(0);
  for (int k = 0; k < 1000; ++k) {
    const StepResult r = arm.step(q);
    if (r.flags != 0) ++held_back;
    for (std::size_t j = 0; j < joints; ++j) context.direction[j] = arm.device->cycle().direction(j);
    const auto left = remaining_error(*model, r.q, q, context);
    greatest = std::max(greatest, left.position_m);
    ASSERT_LE(left.position_m, r.remaining_position_m + real(2e-6));
    ASSERT_LE(left.orientation_rad, r.remaining_orientation_rad + real(4e-6));
  }
  EXPECT_GT(held_back, 5);
  EXPECT_GT(greatest, real(1e-3));
}

TEST(Step, TheNoiseOfAForceIsFollowedWithoutDelay) {
  Arm arm;
  const Bytes image = make_image(arm.robot, 1);
  ASSERT_EQ(arm.push(image), Answer::accepted);
  const Joints q = some_joints();
  FirmwareContext c = default_context<Scalar>(arm.robot);
  for (int k = 0; k < 500; ++k) arm.device->step(q, c);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> noise(-0.2, 0.2);
  for (int k = 0; k < 100; ++k) {
    for (auto& f : c.force_n) f = real(noise(random));
    const StepResult r = arm.device->step(q, c);
    FirmwareContext tracked = c;
    for (std::size_t j = 0; j < joints; ++j) tracked.direction[j] = arm.device->cycle().direction(j);
    EXPECT_EQ(r.q, by_the_core(arm.robot, image, q, tracked).q);
    EXPECT_EQ(r.status, StepStatus::ok);
  }
}

// The finding: of near_singular, limited and at_limit only one was seen.
TEST(Step, EveryFlagIsSeen) {
  Arm arm(following_at_once());
  ASSERT_EQ(arm.push(make_image(arm.robot, 1, 20)), Answer::accepted);
  Joints q = some_joints();
  q[4] = 0;  // the wrist is straight
  q[0] = real(2.2);
  arm.step(q);
  StepResult r = arm.step(q);
  q[0] = real(-2.2);
  arm.step(q);
  const StepResult other = arm.step(q);
  if ((r.flags & step_flag::at_limit) == 0) r = other;
  EXPECT_EQ(r.status, StepStatus::at_limit);
  EXPECT_EQ(r.flags, step_flag::at_limit | step_flag::near_singular);
  EXPECT_EQ(arm.device->cycle().publication().last_flags.load(), other.flags);
}

TEST(Step, SettlingStaysWithinTheLimits) {
  Arm arm;
  std::mt19937 random(6);
  for (std::uint32_t n = 1; n <= 10; ++n) {
    ASSERT_EQ(arm.stage(make_image(arm.robot, n, 4, n)), Answer::accepted);
    ASSERT_EQ(arm.run(Command::commit), Answer::accepted);
    for (int k = 0; k < 300; ++k) {
      arm.device->store().poll(++arm.now_ms);
      Joints q;
      for (auto& v : q) v = random() % 2 != 0 ? real(2.2) : real(-2.2);
      const StepResult r = arm.step(q);
      for (const Scalar v : r.q) {
        ASSERT_LE(v, real(2.2));
        ASSERT_GE(v, real(-2.2));
      }
    }
  }
}

// Where the correction of a held output leads over a limit, the limit holds; and where the command comes back
// the output moves no farther than the command does.
TEST(Step, AHeldOutputStaysWithinTheLimits) {
  DeviceSettings settings;
  settings.control.on_refusal = OnRefusal::pass_through;
  Arm arm(settings);
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), Answer::accepted);
  const Joints q = some_joints();
  Joints good{};
  for (int k = 0; k < 300; ++k) good = arm.step(q).q;
  Joints end = q;
  for (std::size_t j = 0; j < joints; ++j) end[j] = good[j] > q[j] ? real(2.2) : real(-2.2);
  FirmwareContext unknown = default_context<Scalar>(arm.robot);
  unknown.temperature_c = std::numeric_limits<Scalar>::quiet_NaN();
  const StepResult limited = arm.device->step(end, unknown);
  EXPECT_EQ(limited.status, StepStatus::refused);
  EXPECT_NE(limited.flags & step_flag::at_limit, 0);
  EXPECT_EQ(limited.q, end);
  Joints broken = end;
  broken[5] = std::numeric_limits<Scalar>::quiet_NaN();
  EXPECT_EQ(arm.step(broken).q, end);
  arm.device->step(end, unknown);
  const StepResult back = arm.step(end);
  for (std::size_t j = 0; j < joints; ++j) EXPECT_NEAR(back.q[j], end[j], 20e-6 * (1 + 1e-9));
}

// Also while a set settles and the arm moves on meanwhile.
TEST(Step, NoJointIsEverCorrectedByMoreThanTheLargestCorrection) {
  DeviceSettings settings;
  settings.control.compensation.largest_correction_rad = real(1e-4);
  Arm arm(settings);
  std::mt19937 random(9);
  for (std::uint32_t n = 1; n <= 10; ++n) {
    ASSERT_EQ(arm.stage(make_image(arm.robot, n, 4, n)), Answer::accepted);
    ASSERT_EQ(arm.run(Command::commit), Answer::accepted);
    for (int k = 0; k < 300; ++k) {
      arm.device->store().poll(++arm.now_ms);
      const Joints q = some_pose(random);
      const StepResult r = arm.step(q);
      for (std::size_t j = 0; j < joints; ++j) ASSERT_LE(std::abs(r.q[j] - q[j]), real(1.005e-4)) << k;
    }
  }
}

TEST(Step, TracksTheDirectionThroughADeadBand) {
  DeviceSettings settings;
  settings.control.direction_band_rad = real(1e-3);
  Arm arm(settings);
  const auto go = [&arm](double q1) {
    Joints q{};
    q[1] = real(q1);
    arm.step(q);
    return static_cast<double>(arm.device->cycle().direction(1));
  };
  EXPECT_EQ(go(0), 0);
  EXPECT_NEAR(go(0.00025), 0.5, 1e-6);
  EXPECT_EQ(go(0.1), 1);
  EXPECT_NEAR(go(0.1 - 0.0005), 0, 1e-4);  // half the band
  EXPECT_NEAR(go(0.1 - 0.0010), -1, 1e-4);
  EXPECT_EQ(go(-0.1), -1);
  for (int k = 0; k < 1000; ++k)
    EXPECT_LT(go(-0.1 + (k % 2 != 0 ? 1e-5 : 0)), -0.97);  // noise is no reversal
  EXPECT_EQ(arm.device->cycle().direction(0), Scalar(0));
}

TEST(Step, SurvivesAnyBits) {
  Arm arm;
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), Answer::accepted);
  std::mt19937_64 random(8);
  for (int k = 0; k < 100000; ++k) {
    const auto any = [&random] { return static_cast<Scalar>(double_of(random())); };
    Joints q;
    FirmwareContext c;
    for (auto& v : q) v = random() % 4 != 0 ? real(static_cast<double>(random() % 1000) * 1e-3) : any();
    c.payload_kg = any();
    for (auto& v : c.force_n) v = any();
    c.temperature_c = any();
    c.time_s = any();
    const StepResult r = arm.device->step(q, c);
    for (std::size_t j = 0; j < joints; ++j) {
      ASSERT_TRUE(is_finite(r.q[j]));
      ASSERT_LE(std::abs(r.q[j]), real(2.2));
      if (r.status == StepStatus::ok) {
        ASSERT_LE(std::abs(r.q[j] - q[j]), real(0.1));
      }
    }
  }
  const Joints home{};
  StepResult r{};
  for (int k = 0; k < 5000; ++k) r = arm.step(home);  // from any output that stands, at 0.5 rad/s
  EXPECT_EQ(
      r.status,
      by_the_core(arm.robot, make_image(arm.robot, 1), home, default_context<Scalar>(arm.robot)).status);
  const wire::Status s = arm.device->status();
  std::uint32_t sum = 0;
  for (const auto n : s.cycles_by_status) sum += n;
  EXPECT_EQ(sum, s.cycles);
}

}  // namespace
}  // namespace flexcomp::firmware::bench
