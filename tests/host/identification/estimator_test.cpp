// SPDX-License-Identifier: Apache-2.0
// What the estimator promises: uncertainty that is right, bounds that physics sets, prior knowledge, and time.
#include "identification/estimator.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <map>
#include <string>
#include <vector>

#include "files/tolerance_file.hpp"
#include "identification/identify.hpp"
#include "identification/validate.hpp"
#include "input_error.hpp"
#include "model/paper_model.hpp"
#include "support/measuring.hpp"
#include "support/text_file.hpp"

namespace {

using namespace measuring;

double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// The same poses, measured once without noise and then with noise as often as wanted.
class Repeated : public ::testing::Test {
 protected:
  void prepare_poses(std::size_t count, const std::vector<double>& payloads, bool physical) {
    Measuring how{.noise = 0, .payload_kg = payloads};
    clean_ = measure(robot_, truth(), count, 77, how);
    const Identification exact =
        identify(robot_, clean_, "clean", {.physical = physical, .estimator = {.robust = false}});
    unknowns_ = exact.identifiability.fitted;
    // What is lumped (d1 + base z) is what these data mean by the parameter.
    for (const Parameter& p : unknowns_.parameters) true_.push_back(p.get(exact.fit.estimate.set));
    start_.set = paper_model(robot_.nominal, ModelKind::full, true).set;
    at_truth_ = exact.fit.estimate;
    ASSERT_EQ(unknowns_.count(), 36U);
  }

  Fit draw(std::uint64_t seed, const EstimatorOptions& options) const {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    const auto vector = [&](double sigma) {
      const double x = sigma * normal(random);
      const double y = sigma * normal(random);
      return Eigen::Vector3d(x, y, sigma * normal(random));
    };
    std::vector<Observation> rows = clean_;
    for (Observation& row : rows) {
      row.p_m += vector(measuring::kPosition);
      row.R = rotation_of(vector(measuring::kOrientation)) * row.R;
    }
    return fit(start_, unknowns_, rows, robot_, options);
  }

  /// Smallest variances that any unbiased estimator can have, SI.
  Eigen::VectorXd cramer_rao() const {
    const auto model = prepare(at_truth_.set, robot_, "truth");
    const Eigen::MatrixXd j = linearised(at_truth_, *model, clean_, unknowns_).derivative;
    const Eigen::VectorXd units = units_of(unknowns_, at_truth_.set);
    return (j.transpose() * j).inverse().diagonal().cwiseProduct(units.cwiseAbs2());
  }

  Robot robot_ = tx60l();
  std::vector<Observation> clean_;
  Unknowns unknowns_;
  std::vector<double> true_;
  Estimate start_;
  Estimate at_truth_;
};

TEST_F(Repeated, UnboundedEstimatesReachTheCramerRaoBoundAndTheirIntervalsAreRight) {
  prepare_poses(40, {0, 1.108}, false);
  constexpr std::uint64_t draws = 500;
  const EstimatorOptions options{.robust = false};
  std::vector<int> inside(36, 0);
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(36);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(36);
  for (std::uint64_t k = 0; k < draws; ++k) {
    const Fit f = draw(k, options);
    ASSERT_TRUE(f.converged) << k;
    for (std::size_t p = 0; p < 36; ++p) {
      const double value = unknowns_.parameters[p].get(f.estimate.set);
      inside[p] += f.interval[p].low <= true_[p] && true_[p] <= f.interval[p].high ? 1 : 0;
      sum[static_cast<Eigen::Index>(p)] += value - true_[p];
      squares[static_cast<Eigen::Index>(p)] += std::pow(value - true_[p], 2);
    }
  }
  const double n = static_cast<double>(draws);
  const Eigen::VectorXd variance = (squares - sum.cwiseAbs2() / n) / (n - 1);
  const double ratio = variance.cwiseQuotient(cramer_rao()).mean();
  double pooled = 0;
  for (const int i : inside) pooled += i / n / 36;
  const double least = *std::ranges::min_element(inside) / n;
  std::printf("95 %% intervals cover %.4f pooled, %.3f at least; variance / Cramer-Rao %.4f in the mean\n",
              pooled, least, ratio);
  EXPECT_GE(pooled, 0.94);
  EXPECT_LE(pooled, 0.96);
  EXPECT_GE(least, 0.91);
  EXPECT_GE(ratio, 0.97);
  EXPECT_LE(ratio, 1.03);
}

// 14 poses and one load know some compliances to 200 % only: the estimate often lies at zero.
TEST_F(Repeated, DefaultEstimatesStayPhysicalAndTheirIntervalsCoverAtTheBoundToo) {
  prepare_poses(14, {1.108}, true);
  int inside = 0;
  int bounded = 0;
  int bounded_inside = 0;
  constexpr int draws = 300;
  for (std::uint64_t k = 0; k < draws; ++k) {
    const Fit f = draw(1000 + k, EstimatorOptions());
    ASSERT_TRUE(f.converged) << k;
    for (std::size_t p = 0; p < 36; ++p) {
      const bool covers = f.interval[p].low <= true_[p] && true_[p] <= f.interval[p].high;
      inside += covers ? 1 : 0;
      const double least = unknowns_.prior[p].least;
      EXPECT_GE(unknowns_.parameters[p].get(f.estimate.set), least);
      EXPECT_LE(least, f.interval[p].low);
      if (!f.at_bound[p]) continue;
      EXPECT_EQ(unknowns_.parameters[p].get(f.estimate.set), least) << "at its bound, not beside it";
      EXPECT_EQ(f.interval[p].low, least) << "one-sided";
      ++bounded;
      bounded_inside += covers ? 1 : 0;
    }
  }
  const double pooled = inside / 36.0 / draws;
  std::printf("default estimator: intervals cover %.4f pooled; %d one-sided ones, of which %.3f cover\n",
              pooled, bounded, static_cast<double>(bounded_inside) / bounded);
  EXPECT_GE(pooled, 0.93);
  ASSERT_GT(bounded, 100) << "nothing was at its bound: this test tests nothing";
  EXPECT_GE(bounded_inside, 0.93 * bounded);
}

// The bounded minimum against all 2^5 choices of held compliances.
TEST_F(Repeated, TheBoundedMinimumIsTheBestOfAllChoices) {
  prepare_poses(14, {1.108}, true);
  std::vector<std::size_t> bounded;
  for (std::size_t p = 0; p < 36; ++p) {
    if (unknowns_.prior[p].least == 0) bounded.push_back(p);
  }
  ASSERT_EQ(bounded.size(), 5U);
  const EstimatorOptions options{.robust = false};
  int several = 0;
  for (std::uint64_t k = 0; k < 20; ++k) {
    const Fit f = draw(5000 + k, options);
    several += std::ranges::count(f.at_bound, true) >= 2 ? 1 : 0;
    double best = 1e300;
    const Unknowns all = unknowns_;
    for (unsigned mask = 0; mask < 32; ++mask) {
      unknowns_ = Unknowns();
      for (std::size_t p = 0; p < 36; ++p) {
        const auto place = std::ranges::find(bounded, p);
        if (place != bounded.end() && (mask >> (place - bounded.begin()) & 1U) != 0) continue;
        unknowns_.parameters.push_back(all.parameters[p]);
      }
      const Fit free = draw(5000 + k, options);
      bool allowed = true;
      for (const std::size_t p : bounded)
        allowed = allowed && all.parameters[p].get(free.estimate.set) >= -1e-15;
      if (allowed) best = std::min(best, free.chi2);
    }
    unknowns_ = all;
    EXPECT_NEAR(f.chi2, best, 1e-6 * best) << k;
  }
  EXPECT_GT(several, 0);
}

TEST_F(Repeated, TimeIsWhatAMonteCarloStudyNeeds) {
  prepare_poses(14, {1.108}, true);
  const EstimatorOptions options{.robust = false};
  double start = processor_seconds();
  constexpr int draws = 100;
  for (std::uint64_t k = 0; k < draws; ++k) draw(k, options);
  const double each = (processor_seconds() - start) / draws;
  const auto rows = measure(robot_, truth(), 1000, 5);
  double best = 1e9;
  for (int k = 0; k < 3; ++k) {
    start = processor_seconds();
    ASSERT_TRUE(fit(start_, unknowns_, rows, robot_, EstimatorOptions()).converged);
    best = std::min(best, processor_seconds() - start);
  }
  std::printf("36 parameters from 1,000 poses: %.1f ms of one core; 500 calibrations of 14 poses: %.2f s\n",
              best * 1e3, 500 * each);
#if defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "sanitizers are slow";
#else
  // Goals 50 ms and 2 s of processor time; twice that is a regression and not a busy machine.
  EXPECT_LT(best, 0.1);
  EXPECT_LT(500 * each, 4);
#endif
}

TEST(Fixed, AParameterThatIsKnownIsNotFittedAndFreesWhatItWasConfoundedWith) {
  const Robot robot = tx60l();
  const auto rows = measure(robot, truth(), 40, 4);
  IdentifyOptions options;
  options.fixed = {{"link1.d_mm", -0.4e-3}, {"link5.alpha_deg", 0}};
  const Identification r = identify(robot, rows, "data", options);
  EXPECT_EQ(r.parameters, 39U);
  EXPECT_EQ(r.identifiable, 35U) << "two are given, base z is known again";
  const auto v = values_of(r.calibration.terms, robot);
  EXPECT_EQ(v.at("link1.d_mm"), -0.4e-3);
  EXPECT_NEAR(v.at("base.z_mm"), 0.1e-3, 0.05e-3);
  EXPECT_EQ(v.count("link5.alpha_deg"), 0U);
  for (std::size_t k = 0; k < r.calibration.terms.terms.size(); ++k) {
    const Term<double>& t = r.calibration.terms.terms[k];
    if (t.place == Place{1, slot::d} && t.basis == Basis::one) {
      EXPECT_TRUE(std::isnan(r.calibration.sigma[k]));
    }
  }
  options.fixed = {{"link2.d_mm", 0}};  // link 2 has no d
  support::expect_refused([&] { identify(robot, rows, "data", options); }, 0, "link2.d_mm", {"link2.d_mm"});
}

TEST(Tolerances, HoldWhatTheDataDoNotKnowAndLeaveTheRest) {
  const Robot robot = tx60l();
  const auto others = measure(robot, truth(), 200, 9);
  const std::string file = support::write(
      "tolerances.yaml",
      "tolerances:\n  link*.theta_deg: 0.1\n  link*.d_mm: 0.3\n  link*.a_mm: 0.1\n  link*.alpha_deg: 0.05\n"
      "  link2.beta_deg: 0.05\n  base.*_mm: 0.3\n  base.*_deg: 0.03\n"
      "  joint_compliance[joint=*].rad_per_nm: {expected: 5e-4, sigma: 1e-3}\n"
      "  link_gravity.*_rad: 0.002\n");
  IdentifyOptions with;
  with.tolerances = load_tolerances(file);
  ASSERT_EQ(with.tolerances.size(), 9U);
  // 5 poses know less than 36 numbers: without tolerances some are left out, with them all have a value.
  const auto few = measure(robot, truth(), 5, 31);
  const Identification bare = identify(robot, few, "few", {});
  const Identification held = identify(robot, few, "few", with);
  EXPECT_LT(bare.identifiable, 36U);
  EXPECT_EQ(held.identifiable, 36U);
  EXPECT_FALSE(held.identifiability.missing.empty()) << "that the data do not know them is still said";
  EXPECT_FALSE(held.doubts.empty());
  EXPECT_TRUE(held.fit.converged);
  // In the mean over many sets of few poses prior knowledge helps on poses that were not measured.
  double error_bare = 0;
  double error_held = 0;
  for (std::uint64_t seed = 40; seed < 60; ++seed) {
    const auto rows = measure(robot, truth(), 8, seed);
    error_bare +=
        validate(robot, identify(robot, rows, "rows", {}).calibration, others, "others").after.mean_m;
    error_held +=
        validate(robot, identify(robot, rows, "rows", with).calibration, others, "others").after.mean_m;
  }
  std::printf("8 poses: %.4f mm on others, with tolerances %.4f mm\n", error_bare / 20 * 1e3,
              error_held / 20 * 1e3);
  EXPECT_LT(error_held, error_bare);
  // Many poses: nothing is moved by more than its own uncertainty.
  const auto many = measure(robot, truth(), 200, 8);
  const Identification a = identify(robot, many, "many", {});
  const Identification b = identify(robot, many, "many", with);
  const auto va = values_of(a.calibration.terms, robot);
  for (const Parameter& p : parameters_of(b.calibration.terms, robot.nominal)) {
    EXPECT_NEAR(p.get(b.calibration.terms), va.at(p.name), b.calibration.sigma[p.terms.front()]) << p.name;
  }
}

TEST(Tolerances, APatternThatNamesNothingIsRefusedWithItsLine) {
  const std::string file =
      support::write("tolerances.yaml", "tolerances:\n  link*.theta_deg: 0.1\n  link7.d_mm: 0.3\n");
  const Robot robot = tx60l();
  IdentifyOptions options;
  options.tolerances = load_tolerances(file);
  support::expect_refused([&] { identify(robot, measure(robot, truth(), 20, 1), "data", options); }, 3,
                          "link7.d_mm", {"link*.d_mm"});
  for (const char* bad : {"tolerances:\n  a: 0\n", "tolerances:\n  a: -1\n", "tolerance:\n  a: 1\n",
                          "tolerances:\n  a: {sigma: 1, mean: 2}\n", "tolerances:\n  a: x\n",
                          "tolerances:\n  a: 1\n  a: 2\n", "tolerances: 3\n"}) {
    EXPECT_THROW(load_tolerances(support::write("wrong.yaml", bad)), InputError) << bad;
  }
}

TEST(Payloads, NoneAtAllIsAnsweredWithPosesThatHaveOne) {
  const Robot robot = tx60l();
  Measuring how{.payload_kg = {0}};
  auto rows = measure(robot, truth(), 40, 3, how);
  const Identification r = identify(robot, rows, "data", {});
  EXPECT_EQ(r.identifiability.missing.size(), 5U);
  for (const std::string& name : r.identifiability.missing)
    EXPECT_EQ(name.rfind("joint_compliance", 0), 0U) << name;
  EXPECT_FALSE(r.doubts.empty());
  ASSERT_FALSE(r.identifiability.suggested_poses.empty());
  for (const SuggestedPose& c : r.identifiability.suggested_poses)
    EXPECT_EQ(c.payload_kg, robot.nominal.payload_kg);
  const auto model = prepare(truth(), robot, "truth");
  std::mt19937_64 random(8);
  for (const SuggestedPose& c : r.identifiability.suggested_poses) {
    how.payload_kg = {c.payload_kg};
    rows.push_back(measure(*model, c.q_rad, rows.size(), how, random));
  }
  const Identification cured = identify(robot, rows, "data", {});
  EXPECT_TRUE(cured.identifiability.missing.empty());
  EXPECT_EQ(cured.identifiable, 36U);
}

TEST(Payloads, OneIsAnsweredWithWhatASecondWouldGain) {
  const Robot robot = tx60l();
  Measuring how;
  const Identification one = identify(robot, measure(robot, truth(), 200, 3, how), "data", {});
  EXPECT_TRUE(one.identifiability.missing.empty());
  ASSERT_FALSE(one.identifiability.payload_gains.empty());
  how.payload_kg = {0, 1.108};
  const Identification two = identify(robot, measure(robot, truth(), 200, 3, how), "data", {});
  EXPECT_TRUE(two.identifiability.payload_gains.empty());
  for (const PayloadGain& gain : one.identifiability.payload_gains) {
    const auto& parameters = two.identifiability.fitted.parameters;
    const auto p = std::ranges::find(parameters, gain.parameter, &Parameter::name);
    const Eigen::Index i = p - parameters.begin();
    const double sigma = std::sqrt(two.fit.covariance(i, i)) * unit_of(*p, two.fit.estimate.set);
    EXPECT_NEAR(gain.sigma_with_both / sigma, 1, 0.3) << gain.parameter << ": what was promised came";
  }
}

}  // namespace
