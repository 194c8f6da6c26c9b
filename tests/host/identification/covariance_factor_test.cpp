// SPDX-License-Identifier: Apache-2.0
// The covariance that a calibration stores: exact for few parameters; for curves of many coefficients the band of a
// predicted pose is that of the exact one.
#include "identification/covariance_factor.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <vector>

#include "identification/fitted_calibration.hpp"
#include "identification/validate.hpp"
#include "support/curved_fit.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;
using support::CurvedFit;

/// Compact band over exact band at poses.
struct Bands {
  double rms = 0;  ///< of the ratio from 1
  double least = 0, largest = 0;
  double narrow = 0;  ///< share of the poses below 0.9

  Bands(const Eigen::VectorXd& compact, const Eigen::VectorXd& exact) {
    const Eigen::ArrayXd ratio = compact.array() / exact.array();
    rms = std::sqrt((ratio - 1).square().mean());
    least = ratio.minCoeff();
    largest = ratio.maxCoeff();
    narrow = static_cast<double>((ratio < 0.9).count()) / static_cast<double>(ratio.size());
  }
};

TEST(CovarianceFactor, OfFewParametersIsCholeskys) {
  const CurvedFit few(measuring::tx60l(), 100, 1e-4, 16);
  ASSERT_LE(few.fit.covariance.rows(), exact_parameters);
  const CovarianceFactor c = covariance_factor(few.fit, few.unknowns, few.robot, few.rows);
  EXPECT_EQ(c.own.size(), 0);
  EXPECT_EQ(c.scale.size(), 0);
  const Eigen::MatrixXd lower =
      units_of(few.unknowns, few.fit.estimate.set).asDiagonal() * Llt(few.fit.covariance).lower();
  EXPECT_TRUE((c.factor.array() == lower.array()).all());
  EXPECT_EQ(c.parameters, names_of(few.unknowns));
}

TEST(CovarianceFactor, OfSixCurvesKeepsTheBandOfPredictedPositions) {
  for (const std::size_t rows : {40U, 100U, 400U}) {
    const CurvedFit many(measuring::tx60l(), rows);
    const CovarianceFactor c = covariance_factor(many.fit, many.unknowns, many.robot, many.rows);
    ASSERT_EQ(c.factor.rows(), 768 + 45);
    EXPECT_LE(c.factor.cols(), 45 + 120);
    const Eigen::MatrixXd exact = many.exact();
    const Eigen::MatrixXd j = many.positions(300);
    const Eigen::MatrixXd lower =
        units_of(many.unknowns, many.fit.estimate.set).asDiagonal() * Llt(many.fit.covariance).lower();
    const Bands bands(support::position_bands(j, c.columns()), support::position_bands(j, lower));
    std::printf(
        "  %zu rows, %ld columns: band of positions over the exact one: rms %.3f from 1, %.3f to %.3f\n",
        rows, static_cast<long>(c.factor.cols()), bands.rms, bands.least, bands.largest);
    EXPECT_LT(bands.rms, 0.1);
    EXPECT_LE(bands.narrow, 0.05);
    for (Eigen::Index i = 0; i < c.factor.rows(); ++i) {
      const double sigma = std::sqrt(exact(i, i));
      if (i < 45) {
        EXPECT_NEAR(c.sigma(i), sigma, 1e-9 * sigma) << c.parameters[static_cast<std::size_t>(i)];
        EXPECT_EQ(c.own[i], 0);
        EXPECT_EQ(c.scale[i], 0);
      } else {
        EXPECT_GT(c.sigma(i), 0.99 * sigma) << "at least as uncertain as it is";
        EXPECT_LT(c.sigma(i), 1.5 * sigma);
        EXPECT_NEAR(c.scale[i], sigma / 1000, 0.006 * sigma / 1000);
      }
    }
    // What the other parameters have in common is exact, whatever the curves are.
    const Eigen::MatrixXd others = c.factor.topRows(45) * c.factor.topRows(45).transpose();
    for (Eigen::Index a = 0; a < 45; ++a) {
      for (Eigen::Index b = 0; b < 45; ++b)
        EXPECT_NEAR(others(a, b), exact(a, b), 1e-9 * std::sqrt(exact(a, a) * exact(b, b)));
    }
  }
}

TEST(CovarianceFactor, ColumnsAreTheFactorAndTheDiagonal) {
  CovarianceFactor c;
  c.parameters = {"a", "b"};
  c.factor = Eigen::MatrixXd{{3e-6, 0, 1e-6}, {1e-6, 2e-6, 0}};
  EXPECT_TRUE((c.columns().array() == c.factor.array()).all());
  EXPECT_DOUBLE_EQ(c.sigma(1), std::sqrt(5.0) * 1e-6);
  c.own = Eigen::VectorXd{{0, 2e-6}};
  const Eigen::MatrixXd a = c.columns();
  const Eigen::MatrixXd covariance = a * a.transpose();
  EXPECT_NEAR(covariance(0, 0), 10e-12, 1e-24);
  EXPECT_NEAR(covariance(0, 1), 3e-12, 1e-24);
  EXPECT_NEAR(covariance(1, 1), 9e-12, 1e-24);
  EXPECT_DOUBLE_EQ(c.sigma(1), 3e-6);
  EXPECT_DOUBLE_EQ(c.sigma(0), std::sqrt(10.0) * 1e-6);
}

// Chi-square of other rows must be that of r^T (1 + D C D^T)^-1 r, Eq. (M42), with `own` in C.
TEST(CovarianceFactor, ValidateWhitensWithOwn) {
  const CurvedFit many(measuring::tx60l(), 60);
  Calibration calibration = fitted_calibration(many.fit, many.unknowns, many.robot, many.rows);
  ASSERT_GT(calibration.covariance->own.size(), 0);
  const std::vector<Observation> rows = measuring::measure(many.robot, measuring::truth(), 20, 9);
  const double chi2 = validate(many.robot, calibration, rows, "rows").chi2;
  const auto host = prepare(many.fit.estimate.set, many.robot, "curves");
  const Linearised lin = linearised(estimate_of(calibration), *host, rows, many.unknowns);
  const Eigen::MatrixXd a = lin.derivative *
                            units_of(many.unknowns, many.fit.estimate.set).cwiseInverse().asDiagonal() *
                            calibration.covariance->columns();
  const Eigen::MatrixXd whole = Eigen::MatrixXd::Identity(a.rows(), a.rows()) + a * a.transpose();
  EXPECT_NEAR(chi2, lin.residual.dot(Llt(whole).solve(lin.residual)), 1e-6 * chi2);
  calibration.covariance->own.setZero();
  EXPECT_GT(validate(many.robot, calibration, rows, "rows").chi2, 1.001 * chi2) << "own counts";
}

}  // namespace
