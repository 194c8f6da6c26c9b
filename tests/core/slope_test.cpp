// SPDX-License-Identifier: Apache-2.0
// How fast a correction may change with the command, through and near all singularities of six arms: a sample of what
// slope_search does.
#include <cmath>
#include <cstdio>
#include <utility>

#include <gtest/gtest.h>

#include "support/slope_search.hpp"

namespace {

/// Poses that longer searches found: slopes of 637 to 7,416 while the trace measure decided (commit 9d221a9).
constexpr arms::Joints once_steep[6] = {
    {-2.710647778, 0.706502767, -1.315059231, 0.961054385, -1.483380221, 2.932394531},
    {0.791383999, 0.163606586, -0.476099527, -4.492686142, 1.692002493, -4.289327491},
    {-1.826782156, 1.111679906, -5.297198130, 4.047083844, -5.860885602, 5.869520115},
    {4.023013438, -2.087997381, 1.153992425, -2.442891133, 0.479621786, 4.592250778},
    {0.636712631, -0.191023756, -0.985794844, 1.586766407, 1.312513781, 3.362621256},
    {-2.852802820, -1.620672430, 0.127586377, -1.733695928, 1.923148280, -1.490739098}};

void expect_gentle(double steepest, double most_left, double scale) {
  flexcomp::CompensationSettings<double> settings;
  settings.steepest = steepest;
  for (std::size_t k = 0; k < 6; ++k) {
    const arms::Arm& arm = arms::six()[k];
    const slopes::Subject s = slopes::subject(arm, settings, scale);
    slopes::Found found{slopes::slope_at(s, once_steep[k]), once_steep[k]};
    arms::Random random(61);
    slopes::ascend(s, random, 1000 / arms::part, slopes::step_rad, found);
    for (int n = 0; n < 40 / arms::part; ++n) slopes::climb(s, random, slopes::step_rad, found);
    const slopes::Share left = slopes::share(s, 10000 / arms::part, 62);
    std::printf(
        "[ measured ] %s x%g, steepest %g: slope %.1f; not ok at %.1f %% of random poses; %.2f %% keep more "
        "than 0.02 mm, "
        "at most %.2f mm, %.1f %% more than 1 mrad, at most %.0f mrad\n",
        arm.name, scale, steepest, found.slope, 100 * left.held, 100 * left.position, 1e3 * left.most_m,
        100 * left.orientation, 1e3 * left.most_rad);
    EXPECT_LE(found.slope, steepest) << arm.name;
    EXPECT_LE(left.position, most_left) << arm.name;
    EXPECT_LE(left.worse, 2e-3) << arm.name;
  }
}

TEST(Slope, StaysBelowTheSettingOnSixArms) { expect_gentle(100, 0.08, 1); }

TEST(Slope, OfTwentyCanBeChosen) { expect_gentle(20, 0.22, 1); }

TEST(Slope, OfASmallAndALargeSet) {
  expect_gentle(100, 0.08, 0.2);
  // Three times the errors make the regions three times as large, in squares.
  expect_gentle(100, 0.12, 3);
}

// The wrist follows the link that follows the wrist.
TEST(Slope, OfSetsThatMoveLinks) {
  for (const arms::Arm& arm : arms::six()) {
    for (const auto& [size, order] : {std::pair{1e-4, 1.0}, {5e-4, 1.0}, {2e-3, 1.0}, {1e-3, 8.0}}) {
      const slopes::Subject s = slopes::with_wobble(arm, size, order);
      arms::Random random(63);
      slopes::Found found{0, {}};
      for (int n = 0; n < 20 / arms::part; ++n) slopes::climb(s, random, slopes::step_rad, found);
      std::printf("[ measured ] %s, wobble %g rad, order %g: slope %.1f\n", arm.name, size, order,
                  found.slope);
      EXPECT_LE(found.slope, 200) << arm.name << " " << size;
    }
  }
}

TEST(SingularRegion, FollowsTheSetAndEndsAtRegularPoses) {
  flexcomp::CompensationSettings<double> settings;
  const flexcomp::ToolMotion<double> motion{5e-3, 10e-3, 1};
  const auto once = flexcomp::singular_region(motion, settings);
  const auto twice = flexcomp::singular_region(flexcomp::ToolMotion<double>{10e-3, 20e-3, 1}, settings);
  EXPECT_DOUBLE_EQ(twice.position, 2 * once.position);
  EXPECT_DOUBLE_EQ(twice.orientation, 2 * once.orientation);
  settings.steepest = 50;
  EXPECT_DOUBLE_EQ(flexcomp::singular_region(motion, settings).position, twice.position);
  // Never a singular value above 0.1, never one that rounding hides, whatever the numbers.
  for (const double size : {0.0, 1e-9, 1e-3, 1.0, 1e9, std::nan("")}) {
    for (const double steepest : {1e-3, 100.0, 1e9}) {
      settings.steepest = steepest;
      const auto region = flexcomp::singular_region(flexcomp::ToolMotion<double>{size, size, 2}, settings);
      EXPECT_TRUE(region.position >= 4e-6 && region.position <= 0.01) << size;
      EXPECT_TRUE(region.orientation >= 4e-6 && region.orientation <= 0.01) << size;
      EXPECT_LE(region.length_squared, 1);
    }
  }
}

}  // namespace
