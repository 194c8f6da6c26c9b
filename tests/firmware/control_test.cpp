// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <limits>

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
    ASSERT_EQ(r.sequence, 3U);
    for (std::size_t j = 0; j < joints; ++j) ASSERT_EQ(r.q_rad[j], to_binary64_bits(expected.q[j]));
  }
}

TEST(Probe, SaysWhatItCannotDo) {
  Arm arm;
  const Joints q{};
  FirmwareContext c = default_context<Scalar>(arm.robot);
  EXPECT_EQ(arm.device->probe(request(q, c)).status, static_cast<std::uint16_t>(StepStatus::no_set));
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), Answer::accepted);
  wire::ProbeRequest r = request(q, c);
  r.q_rad[2] = 0x7FF8000000000001ULL;
  const wire::ProbeResponse out = arm.device->probe(r);
  EXPECT_EQ(out.status, static_cast<std::uint16_t>(StepStatus::refused));
  EXPECT_EQ(out.q_rad, r.q_rad);
  EXPECT_EQ(out.position_m, 0U);
  r = request(q, c);
  r.payload_kg = 0x7FF0000000000000ULL;
  EXPECT_EQ(arm.device->probe(r).status, static_cast<std::uint16_t>(StepStatus::refused));
}

TEST(Step, EqualsTheCoreOnceFadedIn) {
  Arm arm(fading_in(10));
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
    ASSERT_EQ(r.q, expected.q);
  }
}

// However sets come and go (pushed, rolled back, on trial and reverted, restored, one in the middle of
// another's fade), the correction moves by no more than the sets' own motion and the share of their
// difference that the fade allows.
TEST(Step, AChangeOfSetNeverMakesTheCommandJump) {
  constexpr std::uint32_t fade = 50;
  Arm arm(fading_in(fade));
  std::mt19937 random(4);
  Joints q{};
  std::vector<Bytes> images;
  for (std::uint32_t n = 1; n <= 20; ++n) images.push_back(make_image(arm.robot, n, 1 + n % 5, n));
  std::uint32_t next = 0;
  Joints last{};
  double largest_step = 0;
  double largest_correction = 0;
  bool first = true;
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
    Joints correction;
    for (std::size_t j = 0; j < joints; ++j) {
      correction[j] = r.q[j] - q[j];
      largest_correction = std::max(largest_correction, std::abs(static_cast<double>(correction[j])));
      if (!first) {
        largest_step = std::max(largest_step, std::abs(static_cast<double>(correction[j] - last[j])));
      }
    }
    last = correction;
    first = false;
  }
  EXPECT_GT(largest_correction, 1e-4);
  EXPECT_GT(largest_step, 0);
  // The fading difference is at most twice the largest correction.
  EXPECT_LE(largest_step, 1.5 / fade * 2 * largest_correction * (1 + 1e-6));
}

TEST(Step, TheFirstSetIsFadedInFromZero) {
  Flash flash;
  { Arm(flash).push(make_image(tx60l(), 1)); }
  Device device(tx60l(), flash.hooks(), fading_in(100));
  device.store().boot();
  const FirmwareContext c = default_context<Scalar>(tx60l());
  const Joints q = some_joints();
  EXPECT_EQ(device.step(q, c).q, q);
  for (int k = 0; k < 100; ++k) device.step(q, c);
  EXPECT_NE(device.step(q, c).q, q);
}

class OnRefusalTest : public testing::TestWithParam<OnRefusal> {};

TEST_P(OnRefusalTest, CommandsThatCannotBeCorrected) {
  DeviceSettings settings = fading_in(20);
  settings.control.on_refusal = GetParam();
  const bool hold = GetParam() == OnRefusal::hold_last_correction;
  Arm arm(settings);
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), Answer::accepted);
  const Joints q = some_joints();
  for (int k = 0; k < 5; ++k) arm.step(q);
  const StepResult good = arm.step(q);
  ASSERT_EQ(good.status, StepStatus::ok);
  for (const Scalar bad : {std::numeric_limits<Scalar>::quiet_NaN(), std::numeric_limits<Scalar>::infinity(),
                           -std::numeric_limits<Scalar>::infinity()}) {
    Joints broken = q;
    broken[3] = bad;
    const StepResult r = arm.step(broken);
    EXPECT_EQ(r.status, StepStatus::refused);
    for (std::size_t j = 0; j < joints; ++j) {
      if (j == 3) {
        EXPECT_FALSE(is_finite(r.q[j]));
      } else {
        EXPECT_EQ(r.q[j], hold ? q[j] + (good.q[j] - q[j]) : q[j]);
      }
    }
    const StepResult again = arm.step(q);
    EXPECT_EQ(again.status, StepStatus::ok);
    EXPECT_EQ(again.q, good.q) << "a command that is not finite leaves no trace";
  }
  // A context that is not finite: the last correction stays, or fades out.
  FirmwareContext c = default_context<Scalar>(arm.robot);
  c.payload_kg = std::numeric_limits<Scalar>::quiet_NaN();
  Joints last = good.q;
  for (int k = 0; k < 30; ++k) {
    const StepResult r = arm.device->step(q, c);
    EXPECT_EQ(r.status, StepStatus::refused);
    for (std::size_t j = 0; j < joints; ++j) {
      EXPECT_LE(std::abs(r.q[j] - last[j]), real(1.51 / 20) * std::abs(good.q[j] - q[j]) + real(1e-7));
    }
    last = r.q;
  }
  if (hold) {
    for (std::size_t j = 0; j < joints; ++j) EXPECT_NEAR(last[j], good.q[j], 1e-7);
  } else {
    EXPECT_EQ(last, q);
  }
  // Beyond a limit.
  Joints beyond = q;
  beyond[0] = real(2.3);
  EXPECT_EQ(arm.step(beyond).status, StepStatus::refused);
}

INSTANTIATE_TEST_SUITE_P(Both, OnRefusalTest,
                         testing::Values(OnRefusal::pass_through, OnRefusal::hold_last_correction));

TEST(Step, FadesStayWithinTheLimits) {
  Arm arm(fading_in(200));
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

// A constant correction must not move a joint over a limit that its command respects, and where the command comes
// back the output moves no farther than the command does.
TEST(Step, AHeldCorrectionStaysWithinTheLimits) {
  DeviceSettings settings = fading_in(200);
  settings.control.on_refusal = OnRefusal::hold_last_correction;
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
  EXPECT_EQ(limited.q, end);
  Joints broken = end;
  broken[5] = std::numeric_limits<Scalar>::quiet_NaN();
  const StepResult r = arm.step(broken);
  for (std::size_t j = 0; j < 5; ++j) EXPECT_EQ(r.q[j], end[j]);
  // Off the limit again the whole correction is still there; and from the limit the recovery is no jump.
  const StepResult off = arm.device->step(q, unknown);
  for (std::size_t j = 0; j < joints; ++j) EXPECT_NEAR(off.q[j], good[j], 1e-6);
  arm.device->step(end, unknown);
  const StepResult back = arm.step(end);
  for (std::size_t j = 0; j < joints; ++j) EXPECT_NEAR(back.q[j], end[j], 1e-6);
}

// Also while a set fades in and the arm moves on meanwhile.
TEST(Step, NoJointIsEverCorrectedByMoreThanTheLargestCorrection) {
  DeviceSettings settings = fading_in(100);
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
      if (!is_finite(q[j])) continue;
      ASSERT_TRUE(is_finite(r.q[j]));
      ASSERT_LE(std::abs(r.q[j] - q[j]), real(0.2) + std::abs(q[j]) * real(1e-6));
    }
  }
  const Joints home{};
  StepResult r{};
  for (int k = 0; k < 2000; ++k) r = arm.step(home);
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
