// SPDX-License-Identifier: Apache-2.0
// One sine and cosine for every target, against the long double of the C library.
#include <flexcomp/trigonometry.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include <gtest/gtest.h>

#include "support/arms.hpp"

namespace {

using flexcomp::SinCos;

/// Largest error in ulps of 1 (the last place of results in [1, 2)), and where.
template <class S>
struct Worst {
  double ulps = 0;
  S at = 0;

  void take(S x, SinCos<S> got) {
    const long double exact = static_cast<long double>(x);
    const long double ulp = static_cast<long double>(std::numeric_limits<S>::epsilon());
    const long double off = std::max(std::abs(static_cast<long double>(got.s) - std::sin(exact)),
                                     std::abs(static_cast<long double>(got.c) - std::cos(exact))) /
                            ulp;
    if (!(static_cast<double>(off) <= ulps)) {
      ulps = static_cast<double>(off);
      at = x;
    }
  }
};

template <class S>
void sweep(S range, double bound) {
  arms::Random random(71);
  Worst<S> near_zero;
  Worst<S> turns;
  Worst<S> whole;
  Worst<S> quarters;
  for (int n = 0; n < 1000000; ++n) {
    const S a = static_cast<S>(random.around(0.8));
    near_zero.take(a, flexcomp::sin_cos(a));
    const S b = static_cast<S>(random.around(7));
    turns.take(b, flexcomp::sin_cos(b));
    const S c = static_cast<S>(random.around(static_cast<double>(range)));
    whole.take(c, flexcomp::sin_cos(c));
  }
  // Around every multiple of pi/4: where the quadrant changes, and where the reduction cancels most.
  const int last = static_cast<int>(static_cast<double>(range) / (flexcomp::pi / 4));
  const S infinity = std::numeric_limits<S>::infinity();
  for (int k = -last; k <= last; ++k) {
    S x = static_cast<S>(static_cast<long double>(k) * 0.785398163397448309615660845819875721L);
    for (int side = 0; side < 2; ++side) {
      S y = x;
      for (int step = 0; step < 3; ++step, y = std::nextafter(y, side == 0 ? infinity : -infinity))
        quarters.take(y, flexcomp::sin_cos(y));
    }
  }
  std::printf(
      "[ measured ] sin_cos, %zu bytes, in ulps of 1: %.3f within 0.8, %.3f within 7, %.3f within %g, %.3f "
      "beside multiples of pi/4 (at %.9g)\n",
      sizeof(S), near_zero.ulps, turns.ulps, whole.ulps, static_cast<double>(range), quarters.ulps,
      static_cast<double>(quarters.at));
  for (const Worst<S>* w : {&near_zero, &turns, &whole, &quarters}) EXPECT_LE(w->ulps, bound) << w->at;
}

TEST(Trigonometry, DoubleWithinItsBound) { sweep<double>(1e5, 0.7); }
TEST(Trigonometry, FloatWithinItsBound) { sweep<float>(1e4F, 0.7); }

template <class S>
void special(S range) {
  const S infinity = std::numeric_limits<S>::infinity();
  const S nan = std::numeric_limits<S>::quiet_NaN();
  for (const S x : {std::nextafter(range, infinity), std::nextafter(-range, -infinity), infinity, -infinity,
                    nan, -nan, std::numeric_limits<S>::max(), std::numeric_limits<S>::lowest()}) {
    EXPECT_TRUE(std::isnan(flexcomp::sin_cos(x).s)) << x;
    EXPECT_TRUE(std::isnan(flexcomp::sin_cos(x).c)) << x;
  }
  for (const S x : {range, -range}) {
    EXPECT_FALSE(std::isnan(flexcomp::sin_cos(x).s));
    EXPECT_FALSE(std::isnan(flexcomp::sin_cos(x).c));
  }
  EXPECT_EQ(flexcomp::sin_cos(S(0)).s, S(0));
  EXPECT_EQ(flexcomp::sin_cos(S(0)).c, S(1));
  for (const S tiny : {std::numeric_limits<S>::denorm_min(), std::numeric_limits<S>::min(), S(1e-12)}) {
    EXPECT_EQ(flexcomp::sin_cos(tiny).s, tiny);
    EXPECT_EQ(flexcomp::sin_cos(-tiny).s, -tiny);
    EXPECT_EQ(flexcomp::sin_cos(tiny).c, S(1));
  }
}

TEST(Trigonometry, NanOutsideTheRangeAndExactAtZero) {
  special<double>(1e5);
  special<float>(1e4F);
}

template <class S>
void symmetric() {
  arms::Random random(72);
  for (int n = 0; n < 100000; ++n) {
    const S x = static_cast<S>(random.around(1e4));
    const SinCos<S> a = flexcomp::sin_cos(x);
    const SinCos<S> b = flexcomp::sin_cos(-x);
    ASSERT_EQ(a.s, -b.s);
    ASSERT_EQ(a.c, b.c);
    ASSERT_NEAR(a.s * a.s + a.c * a.c, S(1), 4 * std::numeric_limits<S>::epsilon());
  }
}

TEST(Trigonometry, SineIsOddAndCosineEvenToTheLastBit) {
  symmetric<double>();
  symmetric<float>();
}

/// rotate(sin_cos(x), delta) against the long double of the exact sum, in ulps of 1.
template <class S>
double rotation_error(double size, double& difference) {
  arms::Random random(73);
  double worst = 0;
  difference = 0;
  const long double ulp = static_cast<long double>(std::numeric_limits<S>::epsilon());
  for (int n = 0; n < 300000; ++n) {
    const S x = static_cast<S>(random.around(7));
    const S delta = static_cast<S>(random.around(size));
    const SinCos<S> before = flexcomp::sin_cos(x);
    const SinCos<S> after = flexcomp::rotate(before, delta);
    const long double sum = static_cast<long double>(x) + static_cast<long double>(delta);
    worst = std::max(
        {worst, static_cast<double>(std::abs(static_cast<long double>(after.s) - std::sin(sum)) / ulp),
         static_cast<double>(std::abs(static_cast<long double>(after.c) - std::cos(sum)) / ulp)});
    // What rotate adds, against what it should add to these very digits.
    const long double sine = std::sin(static_cast<long double>(delta));
    const long double cosine = std::cos(static_cast<long double>(delta));
    const long double s = static_cast<long double>(before.s);
    const long double c = static_cast<long double>(before.c);
    difference = std::max(
        {difference,
         static_cast<double>(std::abs(static_cast<long double>(after.s) - (s * cosine + c * sine)) / ulp),
         static_cast<double>(std::abs(static_cast<long double>(after.c) - (c * cosine - s * sine)) / ulp)});
  }
  return worst;
}

template <class S>
void rotations(double own, double with_kernel) {
  for (const double size : {1e-6, 1e-3, 0.0156, 0.0158, 0.1, 3.0}) {
    double difference = 0;
    const double sum = rotation_error<S>(size, difference);
    std::printf("[ measured ] rotate, %zu bytes, |delta| <= %g: adds %.3f ulp of 1 of its own, %.3f in all\n",
                sizeof(S), size, difference, sum);
    EXPECT_LE(difference, own) << size;
    EXPECT_LE(sum, with_kernel) << size;
  }
}

TEST(Trigonometry, RotateAddsLessThanOneAndAHalfUlp) {
  rotations<double>(1.5, 2);
  rotations<float>(1.5, 2);
}

TEST(Trigonometry, RotateIsContinuousWhereItChangesMethod) {
  const double edge = 0.015625;
  for (const double x : {0.0, 0.7, 2.0, -3.0}) {
    for (const double sign : {1.0, -1.0}) {
      const SinCos<double> below = flexcomp::rotate(flexcomp::sin_cos(x), sign * std::nextafter(edge, 0));
      const SinCos<double> at = flexcomp::rotate(flexcomp::sin_cos(x), sign * edge);
      EXPECT_NEAR(below.s, at.s, 4e-16);
      EXPECT_NEAR(below.c, at.c, 4e-16);
    }
  }
  const SinCos<double> bad = flexcomp::rotate(flexcomp::sin_cos(1.0), std::nan(""));
  EXPECT_TRUE(std::isnan(bad.s) && std::isnan(bad.c));
}

TEST(Trigonometry, ThousandRotationsDoNotDrift) {
  // compensate() turns a reading three times; a user of rotate() may do it oftener.
  SinCos<double> t = flexcomp::sin_cos(0.3);
  for (int n = 0; n < 1000; ++n) t = flexcomp::rotate(t, 1e-4);
  const SinCos<double> exact = flexcomp::sin_cos(0.4);
  EXPECT_NEAR(t.s, exact.s, 1e-13);
  EXPECT_NEAR(t.c, exact.c, 1e-13);
}

TEST(Trigonometry, ComposeIsTheAdditionTheorem) {
  arms::Random random(74);
  for (int n = 0; n < 100000; ++n) {
    const double a = random.around(7);
    const double b = random.around(7);
    const SinCos<double> t = flexcomp::compose(flexcomp::sin_cos(a), flexcomp::sin_cos(b));
    const long double sum = static_cast<long double>(a) + static_cast<long double>(b);
    ASSERT_NEAR(t.s, static_cast<double>(std::sin(sum)), 6e-16);
    ASSERT_NEAR(t.c, static_cast<double>(std::cos(sum)), 6e-16);
  }
}

}  // namespace
