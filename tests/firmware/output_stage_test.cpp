// SPDX-License-Identifier: Apache-2.0
// The output stage alone, in both scalars, by properties over random wanted corrections: whatever comes in,
// every bound holds in every cycle. FLEXCOMP_LONG_CYCLES=100000000 makes the long run (a minute for each
// scalar).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <random>

#include "flexcomp/bytes.hpp"
#include "flexcomp_firmware/output_stage.hpp"

namespace flexcomp::firmware {
namespace {

/// Cycles of a property: a few seconds, or what FLEXCOMP_LONG_CYCLES says.
long stage_cycles(long usual) {
  const char* text = std::getenv("FLEXCOMP_LONG_CYCLES");
  return text != nullptr ? std::atol(text) : usual;
}

template <class S>
class OutputStageTest : public testing::Test {
 protected:
  using Stage = OutputStage<S>;
  using Angles = typename Stage::Angles;
  static constexpr double limit = 2;
  static constexpr double largest = 0.1;

  static Angles all(double v) {
    Angles a;
    a.fill(static_cast<S>(v));
    return a;
  }
  static Stage stage(const MotionBounds<S>& bounds = {}) {
    return Stage(all(-limit), all(limit), static_cast<S>(largest), bounds);
  }
  static double greatest(const Angles& v) { return static_cast<double>(greatest_of(v)); }
  double unit() { return std::uniform_real_distribution<double>(-1, 1)(random_); }
  bool one_in(unsigned n) { return random_() % n == 0; }

  std::mt19937_64 random_{15};
};

using Scalars = testing::Types<double, float>;
TYPED_TEST_SUITE(OutputStageTest, Scalars, );

TYPED_TEST(OutputStageTest, PassesOnWhatIsWantedToTheLastBit) {
  auto stage = this->stage();
  auto q = this->all(0.3);
  auto out = q;
  EXPECT_EQ(stage.follow(q, true, out), 0);
  for (int k = 0; k < 1000; ++k) {
    for (auto& v : q) v += static_cast<TypeParam>(1e-3 * this->unit());
    auto wanted = q;
    for (std::size_t j = 0; j < 6; ++j)
      wanted[j] += static_cast<TypeParam>(1e-3 * std::sin(0.01 * k + static_cast<double>(j)));
    out = wanted;
    if (k == 0) {
      // The first step from 0 is an event of its own.
      while (stage.follow(q, false, out) != 0) out = wanted;
    } else {
      ASSERT_EQ(stage.follow(q, false, out), 0);
    }
    ASSERT_EQ(out, wanted);
  }
}

// One factor for all joints: those that have little to go do not arrive before the others.
TYPED_TEST(OutputStageTest, TheRateIsKeptByOneFactorForAllJoints) {
  MotionBounds<TypeParam> bounds;
  bounds.correction_rate_rad_s[2] = TypeParam(0.5);
  auto stage = this->stage(bounds);
  const auto q = this->all(0);
  auto out = q;
  stage.follow(q, true, out);
  const typename TestFixture::Angles wanted = {TypeParam(0.01), TypeParam(-0.002), TypeParam(0.005), 0, 0, 0};
  for (int k = 1; k < 10; ++k) {
    out = wanted;
    const std::uint16_t flags = stage.follow(q, false, out);
    EXPECT_EQ(flags, step_flag::rate_limited);
    EXPECT_EQ(summary(flags), StepStatus::limited);
    for (std::size_t j = 0; j < 6; ++j)
      EXPECT_NEAR(static_cast<double>(out[j]), static_cast<double>(wanted[j]) * k / 10, 1e-8);
  }
  // The last tenth is what remains: rounding decides on the cycle, and then it is there to the last bit.
  for (int k = 0; k < 2; ++k) {
    out = wanted;
    stage.follow(q, false, out);
  }
  EXPECT_EQ(out, wanted);
}

// An event from rest: the joints return together, on the straight line, and stop exactly.
TYPED_TEST(OutputStageTest, AnOffsetReturnsStraightAndStopsExactly) {
  for (const unsigned cycle_us : {125U, 1000U, 4000U}) {
    MotionBounds<TypeParam> bounds;
    bounds.cycle_us = cycle_us;
    auto stage = this->stage(bounds);
    const auto q = this->all(0);
    auto out = q;
    stage.follow(q, true, out);
    const typename TestFixture::Angles wanted = {TypeParam(0.05),   TypeParam(-0.02), TypeParam(0.01),
                                                 TypeParam(-0.005), TypeParam(0.001), 0};
    int cycles = 0;
    for (std::uint16_t flags = 1; flags != 0; ++cycles) {
      out = wanted;
      flags = stage.follow(q, cycles == 0, out);
      if (flags != 0) {
        EXPECT_EQ(flags, step_flag::settling);
      }
      for (std::size_t j = 1; j < 6; ++j) {
        EXPECT_NEAR(static_cast<double>(out[j] * wanted[0]), static_cast<double>(out[0] * wanted[j]), 1e-8);
      }
      ASSERT_LT(cycles, static_cast<int>(stage.settling_cycles()));
    }
    EXPECT_EQ(out, wanted);
    // 0.05 rad at 0.5 rad/s, and 0.5/20 s for starting and stopping.
    EXPECT_NEAR(cycles * (1e-6 * cycle_us), 0.05 / 0.5 + 0.5 / 20, 0.005 + 3e-6 * cycle_us);
  }
}

TYPED_TEST(OutputStageTest, BoundsThatMakeNoSenseAreReplaced) {
  MotionBounds<TypeParam> bounds;
  bounds.correction_rate_rad_s[0] = TypeParam(-1);
  bounds.correction_rate_rad_s[1] = std::numeric_limits<TypeParam>::quiet_NaN();
  bounds.offset_rate_rad_s = TypeParam(0);
  bounds.offset_acceleration_rad_s2 = std::numeric_limits<TypeParam>::infinity();
  const auto stage = this->stage(bounds);
  const auto usual = this->stage();
  EXPECT_EQ(stage.correction_change_most(0), usual.correction_change_most(0));
  EXPECT_EQ(stage.correction_change_most(1), usual.correction_change_most(1));
  EXPECT_EQ(stage.motion_most(), usual.motion_most());
  EXPECT_EQ(stage.motion_change_most(), usual.motion_change_most());
}

// Random commands and wanted corrections, slow, fast and jumping, with and without events, holds and starts.
TYPED_TEST(OutputStageTest, EveryBoundHoldsInEveryCycle) {
  using S = TypeParam;
  const long cycles = stage_cycles(1000000);
  const double ulp = static_cast<double>(std::numeric_limits<S>::epsilon());
  double fastest_offset = 0, hardest_offset = 0, fastest_correction = 0;
  long longest = 0;
  long done = 0;
  while (done < cycles) {
    MotionBounds<S> bounds;
    const unsigned periods[] = {100, 250, 1000, 1000, 2000, 8000};
    bounds.cycle_us = periods[this->random_() % 6];
    for (S& rate : bounds.correction_rate_rad_s) rate = static_cast<S>(2 + this->unit());
    const double dt = bounds.cycle_us * 1e-6;
    auto stage = this->stage(bounds);
    auto q = this->all(0);
    typename TestFixture::Angles speed{};
    typename TestFixture::Angles wanted{};
    typename TestFixture::Angles drift{};
    auto last_out = q;
    auto last_correction = q;
    auto last_motion = q;
    bool was_held = true;
    bool first = true;
    long since_event = 0;
    for (long k = 0; k < 20000; ++k, ++done) {
      // The command: steady, a reversal, a stop at a limit, now and then a jump.
      for (std::size_t j = 0; j < 6; ++j) {
        if (this->one_in(200)) speed[j] = static_cast<S>(3 * this->unit() * dt);
        q[j] += speed[j];
        if (this->one_in(20000)) q[j] = static_cast<S>(TestFixture::limit * this->unit());
        if (clamp_to(q[j], S(-TestFixture::limit), S(TestFixture::limit))) speed[j] = -speed[j];
      }
      // The wanted correction: drifting (also much faster than any rate), jumping with and without being
      // told.
      bool event = this->one_in(500);
      const bool jumps = event || this->one_in(1000);
      for (std::size_t j = 0; j < 6; ++j) {
        if (this->one_in(100))
          drift[j] = static_cast<S>(std::pow(10.0, 3 * this->unit() - 1) * this->unit() * dt);
        wanted[j] += drift[j];
        if (jumps)
          wanted[j] =
              static_cast<S>(TestFixture::largest * this->unit() * std::pow(10.0, 2 * (this->unit() - 1)));
        if (clamp_to(wanted[j], S(-TestFixture::largest), S(TestFixture::largest))) drift[j] = -drift[j];
      }
      auto out = q;
      const bool refused = this->one_in(300);
      if (refused) {
        auto broken = q;
        broken[static_cast<std::size_t>(k % 6)] =
            k % 2 != 0 ? std::numeric_limits<S>::quiet_NaN() : std::numeric_limits<S>::infinity();
        stage.hold(broken, out);
        if (!first) {
          ASSERT_EQ(out, last_out);
        }
        was_held = true;
        for (const S v : out) ASSERT_TRUE(is_finite(v));
        continue;
      }
      double reach = TestFixture::largest;
      for (std::size_t j = 0; j < 6; ++j) {
        out[j] = q[j] + wanted[j];
        clamp_to(out[j], q[j] - S(TestFixture::largest), q[j] + S(TestFixture::largest));
        clamp_to(out[j], S(-TestFixture::limit), S(TestFixture::limit));
      }
      const auto asked = out;
      const std::uint16_t flags = stage.follow(q, event, out);
      since_event = event || was_held ? 0 : since_event + 1;
      if ((flags & step_flag::settling) != 0) longest = std::max(longest, static_cast<long>(since_event));
      if (flags == 0) {
        ASSERT_EQ(out, asked) << k;
      }
      if (was_held && !first) {
        ASSERT_EQ(out, last_out) << "where the arm stands";
      }
      double output_reach = 0;
      for (std::size_t j = 0; j < 6; ++j) {
        ASSERT_TRUE(is_finite(out[j]));
        ASSERT_LE(std::fabs(static_cast<double>(out[j])), TestFixture::limit);
        const double correction = static_cast<double>(out[j] - q[j]);
        output_reach = std::max(output_reach, std::fabs(correction));
        if (!was_held) {
          // The rate, but where a limit forces a joint to give way.
          const double before = static_cast<double>(last_correction[j]);
          const double stands = static_cast<double>(q[j]) + before;
          const double forced = stands > TestFixture::limit || stands < -TestFixture::limit
                                    ? std::fabs(stands) - TestFixture::limit
                                    : 0;
          const double change = std::fabs(correction - before);
          const double most = static_cast<double>(stage.correction_change_most(j));
          ASSERT_LE(change, most * (1 + 4 * ulp) + forced + 4 * TestFixture::limit * ulp) << j << " " << k;
          if (!(forced > 0)) fastest_correction = std::max(fastest_correction, change / most);
          reach = std::max(reach, std::fabs(before));
          const double motion = static_cast<double>(stage.offset_motion()[j]);
          const double change_of_motion = std::fabs(motion - static_cast<double>(last_motion[j]));
          fastest_offset = std::max(fastest_offset, std::fabs(motion) / (0.5 * dt));
          hardest_offset = std::max(hardest_offset, change_of_motion / (20 * dt * dt));
        }
        last_correction[j] = out[j] - q[j];
      }
      if (!was_held) {
        ASSERT_LE(output_reach, reach * (1 + 4 * ulp) + 4 * TestFixture::limit * ulp)
            << "no correction grows beyond the largest";
      }
      last_motion = stage.offset_motion();
      last_out = out;
      was_held = false;
      first = false;
    }
  }
  // Motion in single precision: an offset of 0.1 rad is resolved to 7e-9, the bound at 100 us is 2e-7 rad.
  EXPECT_LE(fastest_offset, 1 + 16 * ulp);
  EXPECT_LE(hardest_offset, 1 + 4096 * ulp);
  std::printf("%ld cycles: offset %.9f of its rate, %.9f of its acceleration, correction %.9f of its rate\n",
              done, fastest_offset, hardest_offset, fastest_correction);
}

// However events follow each other, an offset ends, and soon: in no more than what its size takes and 0.1 s
// for what its motion was before.
TYPED_TEST(OutputStageTest, EveryOffsetEnds) {
  using S = TypeParam;
  const long rounds = stage_cycles(4000000) / 200;
  double longest_s = 0;
  double most_extra_s = 0;
  for (const unsigned cycle_us : {1000U, 250U, 4000U}) {
    MotionBounds<S> bounds;
    bounds.cycle_us = cycle_us;
    const double dt = cycle_us * 1e-6;
    auto stage = this->stage(bounds);
    const auto q = this->all(0);
    auto out = q;
    stage.follow(q, true, out);
    for (long round = 0; round < rounds / 3; ++round) {
      const unsigned events = 1 + static_cast<unsigned>(this->random_() % 6);
      const double size = TestFixture::largest * std::pow(10.0, 2 * (this->unit() - 1));
      auto wanted = q;
      for (unsigned e = 0; e < events; ++e) {
        const long gap = 1 + static_cast<long>(this->random_() % (this->one_in(2) ? 5 : 60));
        for (S& v : wanted) v = static_cast<S>(size * this->unit());
        double way = 0;
        for (long k = 0; e + 1 == events || k < gap; ++k) {
          out = wanted;
          const std::uint16_t flags = stage.follow(q, k == 0, out);
          if (k == 0) way = this->greatest(stage.offset());
          if (e + 1 == events && flags == 0) {
            const double took_s = static_cast<double>(k) * dt;
            longest_s = std::max(longest_s, took_s);
            most_extra_s = std::max(most_extra_s, took_s - way / 0.5 - 0.5 / 20);
            break;
          }
          ASSERT_LT(k, static_cast<long>(stage.settling_cycles())) << "it ends";
        }
      }
      ASSERT_EQ(out, wanted);
    }
  }
  EXPECT_LE(most_extra_s, 0.1);
  std::printf("%ld sequences of events: longest %.3f s, %.3f s beyond what the way takes\n", rounds / 3 * 3,
              longest_s, most_extra_s);
}

}  // namespace
}  // namespace flexcomp::firmware
