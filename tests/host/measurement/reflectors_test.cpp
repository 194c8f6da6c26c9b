// SPDX-License-Identifier: Apache-2.0
#include "measurement/reflectors.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "measurement/observation.hpp"
#include "support/noise.hpp"
#include "support/robot_files.hpp"
#include "support/text_file.hpp"

namespace {

using namespace flexcomp::host;
using namespace flexcomp;
using support::Noise;
using support::tx60l;
using support::Vector6d;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// Rows of measured reflectors with their true poses.
struct MeasuredRows {
  MeasuredData data;
  std::vector<Pose<double>> truth;
};

MeasuredRows measure(std::size_t rows, std::size_t reflectors, double sigma_m, std::uint64_t seed) {
  Noise noise(seed);
  MeasuredRows m;
  m.data.path = "data.csv";
  m.data.kind = MeasurementKind::reflectors;
  m.data.reflectors = reflectors;
  for (std::size_t k = 0; k < rows; ++k) {
    Measurement row;
    row.line = k + 2;
    row.position_sigma_m = sigma_m;
    m.truth.push_back(noise.pose());
    for (std::size_t r = 0; r < reflectors; ++r) {
      row.reflector_m[r] = m.truth.back().rotation * tx60l().reflectors_m[r] + m.truth.back().position +
                           sigma_m * noise.vector();
    }
    m.data.rows.push_back(row);
  }
  return m;
}

Vector6d error_of(const Observation& o, const Pose<double>& truth) {
  return support::error_of({o.R, o.p_m}, truth);
}

TEST(Reflectors, ExactPointsGiveTheExactPose) {
  const MeasuredRows m = measure(20, 4, 1e-13, 1);
  const auto observations = observe(m.data, tx60l());
  for (std::size_t k = 0; k < 20; ++k) EXPECT_LT(error_of(observations[k], m.truth[k]).norm(), 1e-11);
}

TEST(Reflectors, WhitenedErrorsHaveUnitCovariance) {
  for (const std::size_t reflectors : {3U, 4U}) {
    const MeasuredRows m = measure(20000, reflectors, 35e-6, 2);
    std::vector<std::string> warnings;
    const auto observations = observe(m.data, tx60l(), &warnings);
    Matrix6d covariance = Matrix6d::Zero();
    double chi2 = 0;
    for (std::size_t k = 0; k < observations.size(); ++k) {
      const Vector6d w = observations[k].whitening * error_of(observations[k], m.truth[k]);
      covariance += w * w.transpose() / static_cast<double>(observations.size());
      chi2 += observations[k].misfit_chi2 / static_cast<double>(observations.size());
    }
    // The standard error of a variance from 20,000 rows is 1 %.
    EXPECT_LT((covariance - Matrix6d::Identity()).cwiseAbs().maxCoeff(), 0.05) << covariance;
    EXPECT_NEAR(chi2, static_cast<double>(3 * reflectors - 6), 0.1);
    EXPECT_THAT(warnings, IsEmpty());  // 20,000 rows at 1e-6 each
  }
}

TEST(Reflectors, NamesTheReflectorThatMoved) {
  for (const std::size_t reflectors : {3U, 4U}) {
    for (std::size_t moved = 0; moved < reflectors; ++moved) {
      MeasuredRows m = measure(30, reflectors, 35e-6, 3 + moved);
      // Along the line to a neighbour: a distance changes, which is what can be seen.
      const Eigen::Vector3d along =
          m.data.rows[12].reflector_m[moved] - m.data.rows[12].reflector_m[(moved + 1) % 3];
      m.data.rows[12].reflector_m[moved] += 0.5e-3 * along.normalized();
      std::vector<std::string> warnings;
      observe(m.data, tx60l(), &warnings);
      ASSERT_EQ(warnings.size(), 1U);
      EXPECT_THAT(warnings[0], HasSubstr("data.csv:14:"));
      if (reflectors == 4) {
        EXPECT_THAT(warnings[0], HasSubstr(std::string("reflector ") + "ABCD"[moved]));
      }
    }
  }
}

/// What suspect_reflectors() says of simulated slips of one reflector.
struct Verdicts {
  int slips = 0;
  int single = 0;        ///< one reflector was named
  int single_wrong = 0;  ///< and it was not the one
  int missing = 0;       ///< the one that moved is not among the named
  int several = 0;       ///< more than one was blamed
  double expected = 0;   ///< sum of the probabilities of the first named …
  int first_right = 0;   ///< … and how often it was the one
};

Verdicts slips(const Points& shape, std::size_t rows, std::uint64_t seed) {
  constexpr double sigma = 35e-6;
  Noise noise(seed);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> size(std::log(0.1e-3), std::log(10e-3));
  Verdicts v;
  while (v.slips < 3000) {
    const std::size_t moved = random() % shape.size();
    Points slipped = shape;
    slipped[moved] += std::exp(size(random)) * noise.vector().normalized();
    std::vector<Points> measured;
    double chi2 = 0;
    for (std::size_t k = 0; k < rows; ++k) {
      const Pose<double> pose = noise.pose();
      Points row;
      for (const Eigen::Vector3d& p : slipped)
        row.push_back(pose.rotation * p + pose.position + sigma * noise.vector());
      chi2 = fit_rigid(row, shape).squares_m2 / (sigma * sigma);
      measured.push_back(row);
    }
    // As observe() asks it: only what cannot be noise is called a slip.
    if (misfit_probability(chi2, 3 * shape.size() - 6) > 1e-6) continue;
    const Suspicion s = suspect_reflectors(measured, shape, sigma);
    ++v.slips;
    v.several += s.several ? 1 : 0;
    v.single += s.named.size() == 1 ? 1 : 0;
    v.single_wrong += s.named.size() == 1 && s.named[0] != moved ? 1 : 0;
    v.missing += std::find(s.named.begin(), s.named.end(), moved) == s.named.end() ? 1 : 0;
    v.expected += s.probability[s.named[0]];
    v.first_right += s.named[0] == moved ? 1 : 0;
    EXPECT_NEAR(std::accumulate(s.probability.begin(), s.probability.end(), 0.0), 1, 1e-12);
  }
  return v;
}

TEST(Reflectors, ASlipIsBlamedOnTheRightOneOrHonestlyOnSeveral) {
  Points cross = tx60l().reflectors_m;
  const Points three(cross.begin(), cross.begin() + 3);
  const Points uneven{{0, -0.11, 0.02}, {-0.06, 0, 0}, {0.01, 0.07, -0.03}};
  Points lifted = cross;  // no longer in one plane
  lifted[3].z() += 0.04;
  struct Case {
    const char* name;
    Points shape;
    int least_single;  // of 3000
  };
  const std::vector<Case> cases{{"three", three, 1500},
                                {"three, uneven", uneven, 1500},
                                {"cross of four", cross, 1500},
                                {"four, lifted", lifted, 2400}};
  for (const Case& c : cases) {
    int before = 0;
    for (const std::size_t rows : {1U, 10U}) {
      const Verdicts v = slips(c.shape, rows, 17);
      std::printf(
          "%-14s %2zu rows: named alone %.1f %%, wrongly %.2f %%; not among the named %.2f %%; "
          "first right %.1f %% (said %.1f %%); several %.2f %%\n",
          c.name, rows, v.single / 30.0, v.single_wrong / 30.0, v.missing / 30.0, v.first_right / 30.0,
          v.expected / 30.0, v.several / 30.0);
      EXPECT_GT(v.single, c.least_single) << c.name;
      EXPECT_LE(v.single_wrong, 30) << c.name;  // 1 %
      EXPECT_LE(v.missing, 30) << c.name;
      EXPECT_LE(v.several, 3) << c.name;
      // The probabilities are what they say; 3 % is four standard errors.
      EXPECT_NEAR(v.first_right, v.expected, 90) << c.name;
      EXPECT_GT(v.single, before) << c.name << ": ten rows must tell more than one";
      before = v.single;
    }
  }
}

TEST(Reflectors, AChangeOfOneDistanceMayBeEitherEnd) {
  // C moves on a circle about A: only BC changes.
  Points shape(tx60l().reflectors_m.begin(), tx60l().reflectors_m.begin() + 3);
  Points slipped = shape;
  slipped[2] = shape[0] + Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitZ()) * (shape[2] - shape[0]);
  const Suspicion s = suspect_reflectors({slipped}, shape, 35e-6);
  EXPECT_THAT(s.named, testing::UnorderedElementsAre(1U, 2U));
  EXPECT_LT(s.probability[0], 1e-6);
  EXPECT_GT(s.probability[1], 0.1);
  EXPECT_GT(s.probability[2], 0.1);
  // The same from the data: one warning for the whole run of rows, with both letters.
  MeasuredRows m = measure(30, 3, 35e-6, 9);
  for (std::size_t k = 12; k < 18; ++k)
    m.data.rows[k].reflector_m[2] = m.truth[k].rotation * slipped[2] + m.truth[k].position;
  std::vector<std::string> warnings;
  observe(m.data, tx60l(), &warnings);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_THAT(warnings[0],
              testing::AllOf(HasSubstr("data.csv:14-19: one of the reflectors"), HasSubstr(" B ("),
                             HasSubstr(" C ("), HasSubstr(" or "), Not(HasSubstr(" A ("))));
}

TEST(Reflectors, AReflectorThatLeavesThePlaneOfFourMayBeAnyOfThem) {
  Points slipped = tx60l().reflectors_m;
  slipped[1].z() += 0.5e-3;
  EXPECT_EQ(suspect_reflectors({slipped}, tx60l().reflectors_m, 35e-6).named.size(), 4U);
}

TEST(Reflectors, TwoThatMovedAreNotBlamedOnOne) {
  Points slipped = tx60l().reflectors_m;
  slipped[0] += Eigen::Vector3d(0.5e-3, 1e-3, 0);
  slipped[1] += Eigen::Vector3d(-0.8e-3, 0.3e-3, 0);
  EXPECT_TRUE(suspect_reflectors({slipped}, tx60l().reflectors_m, 35e-6).several);
  slipped[1] = tx60l().reflectors_m[1];
  EXPECT_FALSE(suspect_reflectors({slipped}, tx60l().reflectors_m, 35e-6).several);
}

TEST(Reflectors, AnotherSlipOrARowBetweenIsAnotherWarning) {
  MeasuredRows m = measure(40, 4, 35e-6, 10);
  for (const std::size_t k : {10U, 11U, 12U})
    m.data.rows[k].reflector_m[0] += m.truth[k].rotation * Eigen::Vector3d(0, -1e-3, 0);
  for (const std::size_t k : {13U, 14U, 20U})
    m.data.rows[k].reflector_m[1] += m.truth[k].rotation * Eigen::Vector3d(-1e-3, 0.2e-3, 0);
  std::vector<std::string> warnings;
  observe(m.data, tx60l(), &warnings);
  EXPECT_THAT(warnings,
              ElementsAre(HasSubstr("data.csv:12-14: reflector A "),
                          HasSubstr("data.csv:15-16: reflector B "), HasSubstr("data.csv:22: reflector B ")));
}

TEST(Reflectors, AWrongTemplateIsSaidOnce) {
  const MeasuredRows m = measure(30, 4, 35e-6, 4);
  Robot other = tx60l();
  other.reflectors_m[3].x() += 1e-3;
  std::vector<std::string> warnings;
  observe(m.data, other, &warnings);
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("either the template or sigma_mm is wrong")));
}

TEST(Reflectors, FrameOfThePaper) {
  // A, B, C of the reference tool: the foot of the perpendicular from B on AC is the origin of Ftool, X from B to it.
  const Pose<double> frame = reflector_frame(std::span(tx60l().reflectors_m).first(3));
  EXPECT_LT(frame.position.norm(), 1e-15);
  EXPECT_LT((frame.rotation.col(0) - Eigen::Vector3d::UnitX()).norm(), 1e-15);
  EXPECT_LT((frame.rotation.col(1) + Eigen::Vector3d::UnitY()).norm(), 1e-15);  // from C to A
  EXPECT_LT((frame.rotation.col(2) + Eigen::Vector3d::UnitZ()).norm(), 1e-15);
}

TEST(Reflectors, AnEstimatedTemplateHasTheShapeOfTheTool) {
  const MeasuredRows m = measure(400, 4, 35e-6, 5);
  Robot unknown = tx60l();
  unknown.reflectors_m.clear();
  std::vector<std::string> warnings;
  const auto observations = observe(m.data, unknown, &warnings);
  EXPECT_THAT(warnings, IsEmpty());
  // The gauge differs from Ftool by one rigid transform E, the same in every row.
  const Pose<double> e = reflector_frame(std::span(tx60l().reflectors_m).first(3));
  Vector6d mean = Vector6d::Zero();
  for (std::size_t k = 0; k < observations.size(); ++k) {
    const Vector6d error = error_of(observations[k], m.truth[k] * e);
    mean += error / 400;
    EXPECT_LT((observations[k].whitening * error).norm(), 7);
  }
  EXPECT_LT(mean.head<3>().norm(), 1e-5);
  EXPECT_LT(mean.tail<3>().norm(), 1e-4);
}

TEST(Reflectors, RefusesPointsOnOneLine) {
  MeasuredRows m = measure(3, 3, 1e-5, 6);
  m.data.rows[1].reflector_m[1] = (m.data.rows[1].reflector_m[0] + m.data.rows[1].reflector_m[2]) / 2;
  support::expect_refused([&] { observe(m.data, tx60l()); }, 3, "ax_mm … cz_mm", {"one line"});
  m = measure(3, 4, 1e-5, 6);
  Robot three = tx60l();
  three.reflectors_m.pop_back();
  support::expect_refused([&] { observe(m.data, three); }, 0, "tool.reflectors_mm.d", {"data.csv"});
}

TEST(Reflectors, MisfitProbability) {
  // Tables of the chi-square distribution: 5 % above 7.815 (3) and 12.592 (6), 0.1 % above 16.266 and 22.458.
  EXPECT_NEAR(misfit_probability(7.815, 3), 0.05, 1e-5);
  EXPECT_NEAR(misfit_probability(16.266, 3), 0.001, 1e-6);
  EXPECT_NEAR(misfit_probability(12.592, 6), 0.05, 1e-5);
  EXPECT_NEAR(misfit_probability(22.458, 6), 0.001, 1e-6);
  EXPECT_NEAR(misfit_probability(0, 3), 1, 1e-15);
}

TEST(Observation, PosesAndPositionsAreWeightedByTheirSigma) {
  MeasuredData data;
  data.kind = MeasurementKind::pose;
  Measurement row;
  row.position_sigma_m = 1e-4;
  row.orientation_sigma_rad = 1e-3;
  data.rows.push_back(row);
  Observation o = observe(data, tx60l())[0];
  EXPECT_TRUE(o.has_orientation);
  EXPECT_DOUBLE_EQ(o.whitening(2, 2), 1e4);
  EXPECT_DOUBLE_EQ(o.whitening(5, 5), 1e3);
  data.kind = MeasurementKind::position;
  o = observe(data, tx60l())[0];
  EXPECT_FALSE(o.has_orientation);
  EXPECT_EQ(o.whitening(5, 5), 0);
  data.kind = MeasurementKind::joints;
  EXPECT_THROW(observe(data, tx60l()), InputError);
}

}  // namespace
