// SPDX-License-Identifier: Apache-2.0
// The judge judged: what it hides is what it says it hides, and its oracle knows it.
#include "support/hidden_arm.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "flexcomp/forward.hpp"
#include "identification/prior_knowledge.hpp"
#include "judge.hpp"
#include "model/host_model.hpp"
#include "support/text_file.hpp"

namespace {

using namespace flexcomp::host;
using flexcomp::Effect;

/// Position and orientation of the measured point by the library.
flexcomp::Pose<double> by_library(const HostModel& model, const Observation& row) {
  flexcomp::Workspace<double, 6> ws;
  flexcomp::Pose<double> pose = flexcomp::forward(model, row.q_rad, row.context, ws);
  pose.position += pose.rotation * ws.point;
  return pose;
}

/// Motion of the measured point and turn that the hidden part makes, by the plain arm and by the library.
struct Motion {
  Eigen::Vector3d shift, turn;
};

Motion between(const flexcomp::Pose<double>& before, const flexcomp::Pose<double>& after) {
  return {after.position - before.position, rotation_vector(after.rotation * before.rotation.transpose())};
}

flexcomp::Pose<double> pose_of(const plain::Matrix& m) { return {m.topLeftCorner<3, 3>(), plain::origin(m)}; }

/// Largest difference of the two motions, as a share of the largest motion; the latter must be there.
double disagreement(const hidden::Case& c) {
  hidden::Case bare = c;
  bare.hidden.clear();
  bare.outside.reset();
  bare.bump.reset();
  bare.truth = plain::Truth();
  bare.truth.geometric = c.truth.geometric;
  bare.truth.base = c.truth.base;
  bare.truth.tool = c.truth.tool;
  bare.truth.joint_compliance = c.truth.joint_compliance;
  bare.truth.link_gravity = c.truth.link_gravity;
  const auto with = prepare(hidden::terms_of(c), c.robot, "with");
  const auto without = prepare(hidden::terms_of(bare), c.robot, "without");
  double largest = 0;
  double worst = 0;
  for (const Observation& row : c.train) {
    const plain::Situation s = hidden::situation_of(row.context);
    const Motion plain_arm =
        between(pose_of(hidden::true_pose(bare, row.q_rad, s)), pose_of(hidden::true_pose(c, row.q_rad, s)));
    const Motion library = between(by_library(*without, row), by_library(*with, row));
    largest = std::max({largest, plain_arm.shift.norm(), plain_arm.turn.norm()});
    worst =
        std::max({worst, (plain_arm.shift - library.shift).norm(), (plain_arm.turn - library.turn).norm()});
  }
  EXPECT_GT(largest, 1e-7) << c.what;
  return worst / largest;
}

TEST(HiddenArm, ItsEffectsAreThoseOfTheCatalogue) {
  std::map<Effect, int> seen;
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    const hidden::Case c = hidden::draw(hidden::Row::one, seed);
    ++seen[c.hidden.front().id.effect];
    if (seen[c.hidden.front().id.effect] > 4) continue;
    EXPECT_LT(disagreement(c), 1e-8) << seed << " " << c.what;
  }
  EXPECT_EQ(seen.size(), 14U);
  for (const auto& [kind, count] : seen) EXPECT_GT(count, 10) << effect_name(kind);
}

TEST(HiddenArm, WhatStandsOutsideTheCatalogueHasItsShape) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const hidden::Case c = hidden::draw(hidden::Row::outside, seed);
    EXPECT_LT(disagreement(c), 0.05) << seed << " " << c.what;
    const hidden::Case local = hidden::draw(hidden::Row::local, seed);
    EXPECT_LT(disagreement(local), 0.02) << seed << " " << local.what;
    EXPECT_GE(local.inside_the_bump, 1U);
  }
}

TEST(HiddenArm, NothingHiddenMeansThePapersModel) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const hidden::Case c = hidden::draw(hidden::Row::none, seed);
    const auto model = prepare(hidden::terms_of(c), c.robot, "truth");
    for (const Observation& row : c.held_out) {
      const flexcomp::Pose<double> truth =
          pose_of(hidden::true_pose(c, row.q_rad, hidden::situation_of(row.context)));
      const Motion off = between(truth, by_library(*model, row));
      EXPECT_LT(off.shift.norm(), 1e-12);
      EXPECT_LT(off.turn.norm(), 1e-12);
    }
  }
}

TEST(HiddenArm, IsMeasuredWithTheNoiseThatTheRobotFileStates) {
  double chi2 = 0;
  double measured = 0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const hidden::Case c = hidden::draw(hidden::Row::two, seed);
    Estimate truth{.set = hidden::terms_of(c)};
    const auto model = prepare(truth.set, c.robot, "truth");
    const double own = chi_square(residuals(truth, *model, c.train), c.train);
    EXPECT_TRUE(chi_square_is_usual(own, measured_numbers(c.train))) << seed << " " << own;
    chi2 += own;
    measured += measured_numbers(c.train);
  }
  EXPECT_TRUE(chi_square_is_usual(chi2, measured));
}

TEST(HiddenArm, TheSameSeedIsTheSameCase) {
  for (const hidden::Row row : hidden::all_rows()) {
    const hidden::Case a = hidden::draw(row, 17);
    const hidden::Case b = hidden::draw(row, 17);
    const hidden::Case other = hidden::draw(row, 20);
    EXPECT_EQ(a.what, b.what);
    ASSERT_EQ(a.train.size(), hidden::training_poses);
    ASSERT_EQ(a.held_out.size(), hidden::held_out_poses);
    for (std::size_t k = 0; k < a.train.size(); ++k) EXPECT_EQ(a.train[k].p_m, b.train[k].p_m);
    EXPECT_NE(a.train.front().p_m, other.train.front().p_m);
    EXPECT_EQ(a.arm_name, other.arm_name);
  }
}

TEST(HiddenArm, ItsSessionsAreAsTheyAreDescribed) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const hidden::Case c = hidden::draw(hidden::Row::none, seed);
    std::size_t loaded = 0;
    std::set<double> times;
    double t = 0;
    double temperature = 0;
    const double n = static_cast<double>(c.train.size());
    for (const Observation& row : c.train) {
      if (row.context.payload_kg > 0) ++loaded;
      times.insert(row.context.time_s);
      EXPECT_GE(row.context.temperature_c, 18);
      EXPECT_LE(row.context.temperature_c, 32);
      t += row.context.time_s / n;
      temperature += row.context.temperature_c / n;
      double fastest = 0;
      for (std::size_t j = 0; j < 6; ++j) {
        EXPECT_EQ(row.context.direction[j], row.context.relative_speed[j] > 0 ? 1 : -1);
        fastest = std::max(fastest, std::abs(row.context.relative_speed[j]));
        EXPECT_GE(row.q_rad[j], c.robot.nominal.limits[j].min_rad);
        EXPECT_LE(row.q_rad[j], c.robot.nominal.limits[j].max_rad);
      }
      EXPECT_EQ(fastest, 1);
    }
    for (const Observation& row : c.held_out) times.insert(row.context.time_s);
    EXPECT_EQ(times.size(), c.train.size() + c.held_out.size());  // no held-out row is a training row
    EXPECT_GT(loaded, 30U);
    EXPECT_LT(loaded, 60U);
    double tt = 0;
    double cc = 0;
    double tc = 0;
    for (const Observation& row : c.train) {
      tt += std::pow(row.context.time_s - t, 2);
      cc += std::pow(row.context.temperature_c - temperature, 2);
      tc += (row.context.time_s - t) * (row.context.temperature_c - temperature);
    }
    EXPECT_LT(std::abs(tc / std::sqrt(tt * cc)), 0.9) << seed;
  }
}

TEST(HiddenArm, CanBeLookedAtWithTheCommandLine) {
  const support::Folder folder;
  for (const hidden::Row row : hidden::all_rows()) {
    const hidden::Case c = hidden::draw(row, 5);
    const std::string here = folder.path("");
    hidden::dump(c, here);
    const Robot robot = load_robot(here + "/R.yaml");
    const MeasuredData data = load_data(here + "/D.csv", robot);
    const std::vector<Observation> rows = observe(data, robot);
    ASSERT_EQ(rows.size(), c.train.size());
    for (std::size_t k = 0; k < rows.size(); ++k) {
      EXPECT_LT((rows[k].p_m - c.train[k].p_m).norm(), 1e-12);
      EXPECT_LT(rotation_vector(rows[k].R * c.train[k].R.transpose()).norm(), 1e-9);
      EXPECT_TRUE(rows[k].whitening.isApprox(c.train[k].whitening, 1e-9));
      EXPECT_NEAR(rows[k].context.temperature_c, c.train[k].context.temperature_c, 1e-9);
      EXPECT_EQ(rows[k].context.time_s, c.train[k].context.time_s);
      EXPECT_EQ(rows[k].context.payload_kg, c.train[k].context.payload_kg);
      for (std::size_t j = 0; j < 6; ++j) {
        EXPECT_NEAR(rows[k].q_rad[j], c.train[k].q_rad[j], 1e-12);
        EXPECT_NEAR(rows[k].context.relative_speed[j], c.train[k].context.relative_speed[j], 1e-9);
        EXPECT_EQ(rows[k].context.direction[j], c.train[k].context.direction[j]);
      }
    }
    EXPECT_EQ(load_data(here + "/H.csv", robot).rows.size(), c.held_out.size());
    const Calibration truth = load_calibration(here + "/T.yaml", robot);
    EXPECT_EQ(truth.terms.terms.size(), hidden::terms_of(c).terms.size());
  }
}

TEST(Oracle, ExplainsTheDataDownToTheNoise) {
  for (const hidden::Row row : hidden::all_rows()) {
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
      const hidden::Case c = hidden::draw(row, seed);
      // Without its column an effect stays hidden from the oracle too.
      bool blind = false;
      for (const hidden::Effect& e : c.hidden)
        blind = blind || hidden::needs_what_is_missing(e.id.effect, c.roughness);
      if (blind) continue;
      const judging::Oracle oracle = judging::oracle_of(c);
      // A payload error that the data cannot show may leave a flat valley.
      const bool shown = std::ranges::all_of(oracle.hidden, &judging::Hidden::detectable);
      EXPECT_TRUE(oracle.converged || !shown) << hidden::name(row) << seed << " " << c.what;
      const double n = measured_numbers(c.clean_train());
      EXPECT_TRUE(chi_square_is_usual(oracle.chi2, n - 40))
          << hidden::name(row) << seed << " " << oracle.chi2;
    }
  }
}

// Every other name fitted, one after the other, without any shortcut.
TEST(Oracle, NoNameIsBetterThanTheRivalThatItFinds) {
  for (const std::uint64_t seed : {1U, 4U}) {
    const hidden::Case c = hidden::draw(hidden::Row::one, seed);
    const judging::Oracle oracle = judging::oracle_of(c);
    ASSERT_EQ(oracle.hidden.size(), 1U);
    const Fit& base = oracle.before.fit;
    const double log_n = std::log(measured_numbers(c.train));
    const EstimatorOptions plain_squares{.robust = false};
    // The fit of the paper's model alone is one of robust weights; again, without them.
    const Fit none =
        fit(base.estimate, oracle.before.identifiability.fitted, c.train, c.robot, plain_squares);
    const double bic_none =
        none.chi2 + static_cast<double>(oracle.before.identifiability.fitted.count()) * log_n;
    const double bic_truth = bic_none - oracle.hidden.front().detection;
    std::size_t fits = 0;
    double best = bic_none;
    for (const EffectId& id : judging::every_name(c.robot.nominal, c.robot.capsules.front().from_m.z())) {
      if (judging::names_match(id, c.hidden.front().id)) continue;
      if (id.effect == Effect::reflector_slip) continue;
      ParametricModel model{none.estimate.set, oracle.before.identifiability.fitted.parameters};
      const std::size_t first = model.parameters.size();
      add_effect(model, id, c.robot.nominal);
      Estimate start = none.estimate;
      start.set = model.set;
      Unknowns unknowns = oracle.before.identifiability.fitted;
      // Whatever is not its own direction is harmless here: a weak prior keeps the fit regular.
      unknowns.prior.resize(first);
      for (std::size_t p = first; p < model.parameters.size(); ++p) {
        unknowns.parameters.push_back(model.parameters[p]);
        PriorKnowledge weak;
        weak.tolerance = 1e4 * unit_of(model.parameters[p], model.set);
        unknowns.prior.push_back(weak);
      }
      const Fit fitted = fit(start, unknowns, c.train, c.robot, plain_squares);
      // At most one of its own columns is the paper's already.
      const double further = static_cast<double>(model.parameters.size() - first);
      best = std::min(
          best, fitted.chi2 +
                    (static_cast<double>(oracle.before.identifiability.fitted.count()) + further) * log_n);
      ++fits;
    }
    EXPECT_GT(fits, 120U);
    EXPECT_GE(best - bic_truth, oracle.hidden.front().margin - 0.1) << c.what;
  }
}

// A bump whose place must be found costs parameters, but is the truth all the same where it is large and well covered.
TEST(Oracle, FindsABumpWithoutBeingToldItsPlace) {
  std::size_t looked_at = 0;
  for (std::uint64_t seed = 1; looked_at < 4; ++seed) {
    const hidden::Case c = hidden::draw(hidden::Row::local, seed);
    if (c.inside_the_bump < 6 || c.bump->joint > 3) continue;
    ++looked_at;
    const judging::Oracle oracle = judging::oracle_of(c);
    ASSERT_EQ(oracle.hidden.size(), 1U);
    EXPECT_GT(oracle.hidden.front().untold_margin, 10) << seed << " " << c.what;
    EXPECT_LT(oracle.hidden.front().untold_margin, oracle.hidden.front().margin) << seed << " " << c.what;
  }
}

TEST(Rate, HasTheIntervalOfClopperAndPearson) {
  const judging::Rate none{0, 10};
  EXPECT_EQ(none.low(), 0);
  EXPECT_NEAR(none.high(), 0.30850, 1e-5);  // 1 - 0.025^(1/10)
  const judging::Rate all{200, 200};
  EXPECT_NEAR(all.low(), std::pow(0.025, 1.0 / 200), 1e-9);
  EXPECT_EQ(all.high(), 1);
  const judging::Rate some{7, 20};  // binom.test(7, 20): 0.1539092 0.5921885
  EXPECT_NEAR(some.low(), 0.1539092, 1e-6);
  EXPECT_NEAR(some.high(), 0.5921885, 1e-6);
}

}  // namespace
