// SPDX-License-Identifier: Apache-2.0
// A few hidden cases of every row: bounds that a broken diagnosis cannot meet. The rates themselves are the business of
// diagnosis_rates, over hundreds of cases.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "judge.hpp"

namespace {

using judging::Outcome;

struct Tally {
  std::size_t cases = 0, decidable = 0;
  std::size_t right = 0;  ///< of the decidable
  std::size_t right_of_all = 0;
  std::size_t wrong = 0;                     ///< of all
  double before = 0, after = 0, oracle = 0;  ///< squared gaps on the held-out rows
  double worst_ratio = 0;
  std::string report;

  double share_of_oracles_shrink() const { return (1 - after / before) / (1 - oracle / before); }
};

Tally run(hidden::Row row, std::uint64_t first, std::size_t cases) {
  Tally t;
  for (std::uint64_t seed = first; seed < first + cases; ++seed) {
    const Outcome o = judging::judge(hidden::draw(row, seed));
    ++t.cases;
    if (o.decidable) {
      ++t.decidable;
      if (o.right) ++t.right;
    }
    if (o.right) ++t.right_of_all;
    if (o.wrong) ++t.wrong;
    t.before += o.gap2(o.rms_before_m);
    t.after += o.gap2(o.rms_m);
    t.oracle += o.gap2(o.rms_oracle_m);
    t.worst_ratio = std::max(t.worst_ratio, o.ratio());
    t.report += "  " + std::to_string(seed) + " " + o.arm + ": hidden " + o.what + "; said " + o.said +
                (o.right ? " (right)\n" : (o.decidable ? " (NOT RIGHT)\n" : " (undecidable)\n"));
  }
  return t;
}

TEST(Diagnosis, NamesOneHiddenEffect) {
  const Tally t = run(hidden::Row::one, 1, 12);
  EXPECT_GE(t.decidable, 8U) << t.report;
  EXPECT_GE(t.right + 2, t.decidable) << t.report;
  EXPECT_LE(t.wrong, 2U) << t.report;
  EXPECT_GT(t.share_of_oracles_shrink(), 0.8) << t.report;
}

TEST(Diagnosis, FindsNothingWhereNothingIsHidden) {
  const Tally t = run(hidden::Row::none, 1, 9);
  EXPECT_GE(t.right, 8U) << t.report;
  EXPECT_LE(t.wrong, 1U) << t.report;
  EXPECT_LT(t.worst_ratio, 1.1) << t.report;
}

TEST(Diagnosis, CallsADamagedToothACurveOfItsJoint) {
  const Tally t = run(hidden::Row::local, 6, 6);
  EXPECT_GE(t.decidable, 5U) << t.report;
  EXPECT_GE(t.right + 2, t.decidable) << t.report;
  EXPECT_LE(t.wrong, 2U) << t.report;
}

TEST(Diagnosis, GivesNoFalseNameToWhatIsOutsideTheCatalogue) {
  const Tally t = run(hidden::Row::outside, 1, 6);
  EXPECT_GE(t.decidable, 5U) << t.report;
  EXPECT_GE(t.right + 2, t.decidable) << t.report;
  EXPECT_LE(t.wrong, 2U) << t.report;
  EXPECT_GT(t.share_of_oracles_shrink(), 0.3) << t.report;
}

TEST(Diagnosis, NamesTwoAtOnce) {
  const Tally t = run(hidden::Row::two, 1, 8);
  EXPECT_GE(t.decidable, 3U) << t.report;
  EXPECT_GE(t.right + 1, t.decidable) << t.report;
  EXPECT_GT(t.share_of_oracles_shrink(), 0.8) << t.report;
}

TEST(Diagnosis, IsCarefulWithSmallEffects) {
  const Tally t = run(hidden::Row::third, 1, 8);
  EXPECT_GE(t.decidable, 3U) << t.report;
  EXPECT_GE(t.right + 2, t.decidable) << t.report;
  EXPECT_LE(t.wrong, 1U) << t.report;
}

TEST(Diagnosis, FindsWhatThePaperFound) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Outcome o = judging::judge(hidden::draw(hidden::Row::geometry, seed));
    EXPECT_TRUE(o.right) << o.said;
    EXPECT_LT(o.ratio(), 1.1) << o.said;
  }
}

TEST(Diagnosis, StandsRoughData) {
  const Tally t = run(hidden::Row::rough, 1, 6);
  EXPECT_LE(t.wrong, 1U) << t.report;
  EXPECT_GE(t.right_of_all + 2, t.cases) << t.report;
}

}  // namespace
