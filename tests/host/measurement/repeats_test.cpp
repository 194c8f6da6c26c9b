// SPDX-License-Identifier: Apache-2.0
#include "measurement/repeats.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "measurement/reflectors.hpp"
#include "support/noise.hpp"
#include "units.hpp"

namespace {

using namespace flexcomp::host;
using support::Noise;
using support::Vector6d;
using testing::ElementsAre;
using testing::IsEmpty;

#if defined(__SANITIZE_ADDRESS__)
constexpr int draws = 400;
#else
constexpr int draws = 4000;
#endif
/// Of a share p of all draws, four standard errors.
double margin(double p) { return 4 * std::sqrt(p * (1 - p) / draws); }

struct Kind {
  bool orientation = true;
  bool reflectors =
      false;           ///< noise of three reflectors 200 mm away: axes not alike, positions go with turns
  double noise = 1;    ///< true noise in units of the declared
  double missing = 0;  ///< what the model misses at each pose, in units of the declared noise, per number
};

constexpr double sigma_m = 35e-6;
constexpr double sigma_rad = 1.2e-4;

Matrix6d whitening(const Kind& kind, const Eigen::Matrix3d& R) {
  Matrix6d w = Matrix6d::Zero();
  w.topLeftCorner<3, 3>().diagonal().setConstant(1 / sigma_m);
  if (kind.orientation) w.bottomRightCorner<3, 3>().diagonal().setConstant(1 / sigma_rad);
  if (kind.reflectors) {
    const Points tool{{0.2, -0.07, 0}, {0.13, 0, 0}, {0.2, 0.07, 0}};
    w = fit_information({R, Eigen::Vector3d::Zero()}, tool, sigma_m).llt().matrixU();
  }
  return w;
}

struct Measured {
  std::vector<Observation> rows;
  double chi2 = 0;  ///< of the fit of one common offset of all positions, as a model with three parameters
  double dof = 0;
};

/// `counts` rows at each of as many poses; the model is right but for `missing` and the offset.
Measured measured(const std::vector<int>& counts, const Kind& kind, Noise& normal) {
  Measured m;
  std::vector<Vector6d> residuals;
  for (const int count : counts) {
    Observation pose;
    for (double& q : pose.q_rad) q = normal();
    pose.has_orientation = kind.orientation;
    const Eigen::Vector3d at = normal.vector();
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(3 * normal(), normal.vector().normalized()).toRotationMatrix();
    pose.whitening = whitening(kind, R);
    const Eigen::Index n = kind.orientation ? 6 : 3;
    const Eigen::MatrixXd scatter = pose.whitening.topLeftCorner(n, n).inverse();
    const auto draw = [&](double size) {
      Eigen::VectorXd v(n);
      for (double& x : v) x = size * normal();
      Vector6d e = Vector6d::Zero();
      e.head(n) = scatter * v;
      return e;
    };
    const Vector6d missing = draw(kind.missing);
    for (int k = 0; k < count; ++k) {
      const Vector6d e = missing + draw(kind.noise);
      const Eigen::Vector3d w = e.tail<3>();
      pose.p_m = at + e.head<3>();
      pose.R = w.norm() > 0 ? Eigen::Matrix3d(Eigen::AngleAxisd(w.norm(), w.normalized()) * R) : R;
      m.rows.push_back(pose);
      residuals.push_back(e);
      m.dof += static_cast<double>(n);
    }
  }
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < residuals.size(); ++k) {
    const auto w = m.rows[k].whitening.leftCols<3>();
    information += w.transpose() * w;
    sum += w.transpose() * (m.rows[k].whitening * residuals[k]);
  }
  const Eigen::Vector3d offset = information.llt().solve(sum);
  for (std::size_t k = 0; k < residuals.size(); ++k) {
    Vector6d e = residuals[k];
    e.head<3>() -= offset;
    m.chi2 += (m.rows[k].whitening * e).squaredNorm();
  }
  m.dof -= 3;
  return m;
}

TEST(Repeats, AreRowsWithTheSameReadingsAndContext) {
  Noise normal(1);
  std::vector<Observation> rows = measured({1, 1, 1, 1, 1, 1, 1, 1}, {}, normal).rows;
  EXPECT_THAT(repeats(rows), IsEmpty());
  EXPECT_FALSE(pure_error(rows, 1, 1));
  for (const std::size_t k : {3U, 6U, 7U}) rows[k].q_rad = rows[1].q_rad;
  rows[6].q_rad[0] += 0.9e-9;
  rows[4].q_rad = rows[0].q_rad;
  EXPECT_THAT(repeats(rows), ElementsAre(ElementsAre(0, 4), ElementsAre(1, 3, 6, 7)));
  rows[6].q_rad[0] += 0.2e-9;
  EXPECT_THAT(repeats(rows), ElementsAre(ElementsAre(0, 4), ElementsAre(1, 3, 7)));
  rows[3].context.payload_kg = 2;
  EXPECT_THAT(repeats(rows), ElementsAre(ElementsAre(0, 4), ElementsAre(1, 7)));
  rows[7].context.direction[2] = -1;
  EXPECT_THAT(repeats(rows), ElementsAre(ElementsAre(0, 4)));
  rows[4].context.temperature_c += 1;
  EXPECT_THAT(repeats(rows), IsEmpty());
  rows[4] = rows[0];
  rows[4].context.time_s = 60;
  EXPECT_THAT(repeats(rows), IsEmpty());
  rows[4] = rows[0];
  rows[4].q_rad[5] += 2e-9;
  EXPECT_THAT(repeats(rows), IsEmpty());
  EXPECT_THAT(repeats({}), IsEmpty());
}

TEST(Repeats, ByHand) {
  // Two rows 2 mm apart in x: variance 2 mm² over three axes of one free row.
  Observation row;
  row.whitening.topLeftCorner<3, 3>().diagonal().setConstant(1e3);
  std::vector<Observation> rows{row, row};
  rows[1].p_m.x() = 2e-3;
  const auto e = pure_error(rows, 5, 4);
  ASSERT_TRUE(e);
  EXPECT_EQ(e->groups, 1U);
  EXPECT_EQ(e->rows, 2U);
  EXPECT_DOUBLE_EQ(e->dof, 3);
  EXPECT_DOUBLE_EQ(e->sigma_position_m, std::sqrt(2e-6 / 3));
  EXPECT_DOUBLE_EQ(e->covariance(0, 0), 2e-6);
  EXPECT_EQ(e->sigma_orientation_rad, 0);
  EXPECT_DOUBLE_EQ(e->chi2_per_dof_whitened, 2.0 / 3);
  EXPECT_DOUBLE_EQ(*e->lack_of_fit_f, (5.0 - 2) / 1 / (2.0 / 3));
  // F(1, 3) = 4.5: Student's t of 3 degrees beyond 2.1213, two-sided.
  EXPECT_NEAR(*e->lack_of_fit_p, 0.1240, 1e-3);
  // Chi-square of 3: 2.5 % below 0.2158 and above 9.3484.
  EXPECT_NEAR(e->position_interval_m.low, std::sqrt(2e-6 / 9.3484), 1e-8);
  EXPECT_NEAR(e->position_interval_m.high, std::sqrt(2e-6 / 0.2158), 1e-6);
  // As many parameters as there are poses: nothing left to lack.
  EXPECT_FALSE(pure_error(rows, 2, 3)->lack_of_fit_f);
}

TEST(Repeats, HalfATurnIsNoObstacle) {
  Observation row;
  row.has_orientation = true;
  row.whitening.setIdentity();
  row.R = Eigen::AngleAxisd(flexcomp::host::pi, Eigen::Vector3d::UnitX()).toRotationMatrix();
  std::vector<Observation> rows{row, row};
  rows[1].R = Eigen::AngleAxisd(2e-4, Eigen::Vector3d::UnitY()).toRotationMatrix() * row.R;
  EXPECT_NEAR(pure_error(rows, 1, 10)->sigma_orientation_rad, std::sqrt(2e-8 / 3), 1e-12);
}

TEST(Repeats, IntervalsCoverTheTrueScatter) {
  Noise normal(2);
  for (const Kind& kind :
       {Kind{}, Kind{false}, Kind{true, true}, Kind{true, false, 1.7}, Kind{true, true, 1, 3}}) {
    int position = 0;
    int orientation = 0;
    double chi2 = 0;
    double mean_variance = 0;
    double true_variance = 0;
    for (int k = 0; k < draws; ++k) {
      const Measured m = measured({3, 1, 2, 5, 1, 1}, kind, normal);
      const PureError e = *pure_error(m.rows, m.chi2, m.dof);
      ASSERT_EQ(e.dof, kind.orientation ? 42 : 21);
      const Eigen::Index n = kind.orientation ? 6 : 3;
      const Eigen::MatrixXd w = m.rows[0].whitening.topLeftCorner(n, n);
      const Eigen::MatrixXd covariance = kind.noise * kind.noise * (w.transpose() * w).inverse();
      const double sigma = std::sqrt(covariance.topLeftCorner(3, 3).trace() / 3);
      position += e.position_interval_m.low < sigma && sigma < e.position_interval_m.high ? 1 : 0;
      true_variance += sigma * sigma;
      mean_variance += e.sigma_position_m * e.sigma_position_m;
      chi2 += e.chi2_per_dof_whitened / draws;
      if (!kind.orientation) continue;
      const double turn = std::sqrt(covariance.bottomRightCorner(3, 3).trace() / 3);
      orientation += e.orientation_interval_rad.low < turn && turn < e.orientation_interval_rad.high ? 1 : 0;
    }
    std::printf("95 %% intervals cover: position %.1f %%, orientation %.1f %%; variance found / true %.4f\n",
                100.0 * position / draws, 100.0 * orientation / draws, mean_variance / true_variance);
    // Axes that are not alike make the interval an approximation: half a per cent for it.
    EXPECT_NEAR(position, 0.95 * draws, (margin(0.95) + (kind.reflectors ? 0.005 : 0)) * draws);
    if (kind.orientation) {
      EXPECT_NEAR(orientation, 0.95 * draws, (margin(0.95) + (kind.reflectors ? 0.005 : 0)) * draws);
    }
    EXPECT_NEAR(mean_variance / true_variance, 1, kind.reflectors ? 0.05 : 0.03);
    EXPECT_NEAR(chi2, kind.noise * kind.noise, 0.015 * kind.noise * kind.noise * std::sqrt(4000.0 / draws));
  }
}

TEST(Repeats, LackOfFitRaisesNoFalseAlarmWhateverTheTrueNoise) {
  Noise normal(3);
  for (const Kind& kind : {Kind{}, Kind{false}, Kind{true, true}, Kind{true, false, 3}}) {
    int alarms = 0;
    int rare = 0;
    for (int k = 0; k < draws; ++k) {
      const Measured m = measured({3, 1, 2, 3, 1, 4, 1, 1}, kind, normal);
      const PureError e = *pure_error(m.rows, m.chi2, m.dof);
      alarms += *e.lack_of_fit_p < 0.05 ? 1 : 0;
      rare += *e.lack_of_fit_p < 0.001 ? 1 : 0;
    }
    std::printf("false alarms at 5 %%: %.2f %%, at 0.1 %%: %.2f %%\n", 100.0 * alarms / draws,
                100.0 * rare / draws);
    EXPECT_NEAR(alarms, 0.05 * draws, margin(0.05) * draws);
    EXPECT_LE(rare, (0.001 + margin(0.001)) * draws);
  }
}

TEST(Repeats, LackOfFitFindsWhatTheModelMisses) {
  Noise normal(4);
  int found = 0;
  int found_little = 0;
  for (int k = 0; k < draws; ++k) {
    // As large as the noise, which is itself three times what was declared: chi-square alone could not tell.
    Measured m = measured({3, 3, 3, 3, 1, 1, 1, 1, 1, 1}, {true, false, 3, 3}, normal);
    found += *pure_error(m.rows, m.chi2, m.dof)->lack_of_fit_p < 0.01 ? 1 : 0;
    m = measured({3, 3, 3, 3, 1, 1, 1, 1, 1, 1}, {true, false, 1, 0.5}, normal);
    found_little += *pure_error(m.rows, m.chi2, m.dof)->lack_of_fit_p < 0.05 ? 1 : 0;
  }
  std::printf("found: as large as the noise %.1f %% (at 1 %%), half of it %.1f %% (at 5 %%)\n",
              100.0 * found / draws, 100.0 * found_little / draws);
  // Mean squares of lack are 1 + 3 and 1 + 1 noises, about 2.8 on average; F(57, 48) exceeds 1.95 / 2.8 in nine of ten.
  EXPECT_NEAR(found, 0.9 * draws, 0.05 * draws);
  EXPECT_GT(found_little, 0.3 * draws);
}

TEST(Repeats, RowsOfUnequalNoiseAreWeighted) {
  Noise normal(5);
  double chi2 = 0;
  double sum = 0;
  for (int k = 0; k < draws; ++k) {
    Measured m = measured({4, 1}, {}, normal);
    // The second row with a tenth of the noise.
    Observation& precise = m.rows[1];
    precise.whitening *= 10;
    precise.p_m = 0.1 * sigma_m * normal.vector();
    for (std::size_t r : {0U, 2U, 3U}) m.rows[r].p_m = sigma_m * normal.vector();
    const Eigen::Matrix3d R = m.rows[0].R;
    for (std::size_t r : {0U, 2U, 3U}) {
      const Eigen::Vector3d w = sigma_rad * normal.vector();
      m.rows[r].R = Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix() * R;
    }
    const Eigen::Vector3d w = 0.1 * sigma_rad * normal.vector();
    precise.R = Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix() * R;
    const PureError e = *pure_error(m.rows, 100, 40);
    chi2 += e.chi2_per_dof_whitened / draws;
    sum += e.dof / draws;
  }
  EXPECT_NEAR(sum, 18, 1e-9);
  EXPECT_NEAR(chi2, 1, 0.025 * std::sqrt(4000.0 / draws));
}

}  // namespace
