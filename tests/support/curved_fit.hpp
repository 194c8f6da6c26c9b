// SPDX-License-Identifier: Apache-2.0
/// \file
/// A fit with curves of all six joints, as `diagnose` ends with one: its covariance is that of the linear model.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "diagnosis/joint_curves.hpp"
#include "identification/estimator.hpp"
#include "identification/residuals.hpp"
#include "linalg/blas.hpp"
#include "linalg/decompositions.hpp"
#include "model/paper_model.hpp"
#include "support/measuring.hpp"

namespace support {

using namespace flexcomp;
using namespace flexcomp::host;

/// 12 numbers of the frames, 33 of the paper's model and six curves with the prior (D19).
struct CurvedFit {
  Robot robot;
  std::vector<Observation> rows;
  Unknowns unknowns;
  Fit fit;

  CurvedFit(const Robot& of, std::size_t count, double curve_rad = 1e-4,
            std::size_t coefficients = curve_coefficients)
      : robot(of), rows(measuring::measure(of, measuring::truth(), count, 5)) {
    ParametricModel model = paper_model(robot.nominal, ModelKind::full, false);
    unknowns.frames = free_frames(rows);
    unknowns.parameters = model.parameters;
    const auto others = static_cast<Eigen::Index>(unknowns.count());
    const auto size = static_cast<Eigen::Index>(coefficients);
    for (unsigned joint = 1; joint <= joint_count; ++joint) {
      const std::size_t first = model.parameters.size();
      add_effect(model, {.effect = Effect::joint_curve, .joint = joint, .coefficients = coefficients},
                 robot.nominal);
      for (std::size_t k = 0; k < coefficients; ++k) {
        model.parameters[first + k].set(model.set,
                                        curve_rad * std::sin(0.1 * static_cast<double>(joint * k)));
        unknowns.parameters.push_back(model.parameters[first + k]);
      }
    }
    fit.estimate.set = model.set;
    fit.at_bound.assign(unknowns.parameters.size(), false);
    fit.interval.resize(unknowns.parameters.size());
    const auto host = prepare(model.set, robot, "curves");
    Eigen::MatrixXd information = gram(linearised(fit.estimate, *host, rows, unknowns).derivative);
    const Eigen::VectorXd units = units_of(unknowns, model.set);
    information.diagonal().head(others).array() += 1e-4;
    for (Eigen::Index joint = 0; joint < 6; ++joint) {
      const Eigen::Index at = others + joint * size;
      const Eigen::MatrixXd prior = coefficient_covariance(curve_rad, 10, coefficients);
      information.block(at, at, size, size) += Llt(prior).inverse() * (units[at] * units[at]);
    }
    fit.covariance = Llt(information).inverse();
  }

  /// Columns of the measured position at poses that were not fitted, three rows each, SI.
  Eigen::MatrixXd positions(std::size_t count) const {
    std::vector<Observation> poses =
        measuring::measure(robot, measuring::truth(), count, 77, {.pose = false});
    for (Observation& row : poses) row.whitening.topLeftCorner<3, 3>().setIdentity();
    const auto host = prepare(fit.estimate.set, robot, "curves");
    const Eigen::MatrixXd all = linearised(fit.estimate, *host, poses, unknowns).derivative *
                                units_of(unknowns, fit.estimate.set).cwiseInverse().asDiagonal();
    Eigen::MatrixXd out(3 * static_cast<Eigen::Index>(count), all.cols());
    for (Eigen::Index k = 0; k < static_cast<Eigen::Index>(count); ++k)
      out.middleRows<3>(3 * k) = all.middleRows<3>(6 * k);
    return out;
  }

  /// The exact covariance, SI.
  Eigen::MatrixXd exact() const {
    const Eigen::VectorXd units = units_of(unknowns, fit.estimate.set);
    return units.asDiagonal() * fit.covariance * units.asDiagonal();
  }
};

/// Standard deviations of predicted positions, m: square roots of the traces of J A A^T J^T. \param a  A
inline Eigen::VectorXd position_bands(const Eigen::MatrixXd& j, const Eigen::MatrixXd& a) {
  const Eigen::VectorXd squares = product(j, a).rowwise().squaredNorm();
  Eigen::VectorXd out(j.rows() / 3);
  for (Eigen::Index k = 0; k < out.size(); ++k) out[k] = std::sqrt(squares.segment<3>(3 * k).sum());
  return out;
}

}  // namespace support
