// SPDX-License-Identifier: Apache-2.0
/// \file
/// What identify, diagnose and two simple regressions predict of measured arms from few poses. The regressions are oracles:
/// positions alone, one linearisation, no names and no outliers; they share no code with the diagnosis.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "identification/identify.hpp"
#include "support/measured_arm.hpp"

namespace flexcomp::host {

/// Measured rows of one arm: what to fit and what to predict.
struct FewPoses {
  Robot robot;
  ContextColumns columns;
  std::vector<Observation> train, test;
};

/// Random rows of a series; the test rows are the next ones, at most 1,000.
/// \param series  ur10-a, ur10-b or ur5
std::optional<FewPoses> few_poses(const std::string& series, std::size_t poses, unsigned draw);

/// Mean 3-D position error of the test rows, m.
double mean_with(const FewPoses& rows, const Calibration& calibration);

/// Geometry, and sines and cosines of every joint's reading up to order 20 with one penalty, chosen by leaving poses out.
double mean_of_ridge(const FewPoses& rows, const Identification& start);

/// Geometry, and a Gaussian process over every joint's reading: a size each and one spectrum, by marginal likelihood in the
/// space of the rows, coordinate after coordinate.
double mean_of_gaussian_processes(const FewPoses& rows, const Identification& start);

}  // namespace flexcomp::host
