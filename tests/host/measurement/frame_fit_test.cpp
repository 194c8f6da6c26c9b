// SPDX-License-Identifier: Apache-2.0
#include "measurement/frame_fit.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "measurement/observation.hpp"
#include "measurement/reflectors.hpp"
#include "support/noise.hpp"
#include "support/text_file.hpp"

namespace {

using namespace flexcomp::host;
using flexcomp::Pose;
using support::error_of;
using support::Noise;
using support::Vector6d;

Points in_tracker(const Pose<double>& truth, const Points& nominal) {
  Points out;
  for (const Eigen::Vector3d& p : nominal)
    out.emplace_back(truth.rotation.transpose() * (p - truth.position));
  return out;
}

const Points nominal_points{
    {0.5, 0.4, 0}, {-0.5, 0.4, 0.1}, {0.1, -0.6, 0}, {0.3, -0.2, 0.9}, {-0.8, -0.9, 0.2}};

TEST(FrameFit, ExactPointsGiveTheExactFrame) {
  Noise noise(1);
  for (std::size_t n = 3; n <= nominal_points.size(); ++n) {
    const Points nominal(nominal_points.begin(), nominal_points.begin() + static_cast<std::ptrdiff_t>(n));
    const Pose<double> truth = noise.pose(3);
    const FrameFit fit =
        fit_frame(in_tracker(truth, nominal), nominal, std::vector<double>(n, 1e-5), "points.csv");
    EXPECT_LT(error_of(fit.pose, truth).norm(), 1e-13);
    EXPECT_EQ(fit.dof, 3 * static_cast<double>(n) - 6);
    EXPECT_LT(fit.chi2, 1e-10);
    EXPECT_EQ(fit.residual_m.size(), n);
  }
}

TEST(FrameFit, CovarianceIsThatOfTheErrors) {
  Noise noise(2);
  const std::vector<double> unequal{20e-6, 100e-6, 30e-6, 200e-6, 50e-6};
  for (const std::size_t n : {3U, 5U}) {
    for (const bool alike : {true, false}) {
      const Points nominal(nominal_points.begin(), nominal_points.begin() + static_cast<std::ptrdiff_t>(n));
      std::vector<double> sigma(n, 50e-6);
      if (!alike) sigma.assign(unequal.begin(), unequal.begin() + static_cast<std::ptrdiff_t>(n));
      const Pose<double> truth = noise.pose(3);
      const Points exact = in_tracker(truth, nominal);
      constexpr int fits = 2000;
      double square = 0;
      double chi2 = 0;
      int covered = 0;
      Matrix6d whitened = Matrix6d::Zero();
      for (int k = 0; k < fits; ++k) {
        Points measured = exact;
        for (std::size_t i = 0; i < n; ++i) measured[i] += sigma[i] * noise.vector();
        const FrameFit fit = fit_frame(measured, nominal, sigma, "points.csv");
        const Vector6d w = fit.covariance.llt().matrixL().solve(error_of(fit.pose, truth));
        whitened += w * w.transpose() / fits;
        square += w.squaredNorm() / 6 / fits;
        covered += w.squaredNorm() < 12.5916 ? 1 : 0;  // 95 % of a chi-square of 6
        chi2 += fit.chi2 / fit.dof / fits;
      }
      std::printf("%zu points, sigmas %s: errors / covariance %.3f, 95 %% region covers %.1f %%\n", n,
                  alike ? "alike" : "unequal", square, 100.0 * covered / fits);
      EXPECT_NEAR(square, 1, 0.03);
      EXPECT_NEAR(covered / static_cast<double>(fits), 0.95, 0.015);
      EXPECT_LT((whitened - Matrix6d::Identity()).cwiseAbs().maxCoeff(),
                0.13);  // four standard errors of a variance
      EXPECT_NEAR(chi2, 1, 0.08);
    }
  }
}

TEST(FrameFit, WeightsCount) {
  // One point is known badly and is 5 mm off: it must not pull the others.
  Noise noise(3);
  const Pose<double> truth = noise.pose(3);
  Points measured = in_tracker(truth, nominal_points);
  measured[4] += Eigen::Vector3d(5e-3, 0, 0);
  std::vector<double> sigma(5, 1e-5);
  const double pulled =
      error_of(fit_frame(measured, nominal_points, sigma, "x").pose, truth).head<3>().norm();
  sigma[4] = 1;
  const FrameFit fit = fit_frame(measured, nominal_points, sigma, "x");
  EXPECT_GT(pulled, 1e-4);
  EXPECT_LT(error_of(fit.pose, truth).norm(), 1e-6);
  EXPECT_NEAR(fit.residual_m[4].norm(), 5e-3, 1e-5);
  EXPECT_LT(fit.residual_m[0].norm(), 1e-6);
}

TEST(FrameFit, RefusesWhatGivesNoFrame) {
  const std::vector<double> sigma(3, 1e-5);
  const Points three(nominal_points.begin(), nominal_points.begin() + 3);
  const Points two(nominal_points.begin(), nominal_points.begin() + 2);
  const Points line{{0, 0, 0}, {1, 1, 1}, {2, 2, 2.0001}};
  const auto refused = [](const Points& a, const Points& b, const std::vector<double>& s, const char* part) {
    support::expect_refused([&] { fit_frame(a, b, s, "points.csv"); }, 0, s[0] > 0 ? "points" : "sigma",
                            {"points.csv", part});
  };
  refused(two, two, sigma, "three points or more");
  refused(three, nominal_points, sigma, "3 nominal points");
  refused(three, three, {1e-5}, "3 and 1");
  refused(line, three, sigma, "not on one line");
  refused(three, line, sigma, "not on one line");
  refused({three[0], three[0], three[0]}, three, sigma, "not on one line");
  refused(three, three, {0, 1e-5, 1e-5}, "above 0");
}

}  // namespace
