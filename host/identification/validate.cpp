// SPDX-License-Identifier: Apache-2.0
#include "identification/validate.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>

#include "identification/fitted_calibration.hpp"
#include "input_error.hpp"
#include "linalg/blas.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {

namespace {

/// Chi-square r^T (1 + A A^T)^-1 r by the Woodbury identity, Eq. (M42); A = whitened derivative * columns of the
/// covariance.
double chi_square_with_uncertainty(const Estimate& estimate, const HostModel& model,
                                   const std::vector<Observation>& rows, const Calibration& calibration,
                                   const Robot& robot) {
  const CovarianceFactor& covariance = *calibration.covariance;
  Unknowns unknowns;
  const Unknowns every_frame{.frames = free_frames(rows)};
  const std::vector<std::string> frame_names = names_of(every_frame);
  const std::vector<Parameter> parameters = parameters_of(calibration.terms, robot.nominal);
  for (const std::string& name : covariance.parameters) {
    const auto frame = std::ranges::find(frame_names, name);
    const auto parameter = std::ranges::find(parameters, name, &Parameter::name);
    if (frame != frame_names.end()) {
      unknowns.frames.push_back(every_frame.frames[static_cast<std::size_t>(frame - frame_names.begin())]);
    } else if (parameter != parameters.end()) {
      unknowns.parameters.push_back(*parameter);
    } else if (name.rfind("frame_", 0) != 0) {  // positions do not identify all angles of the frames
      throw InputError(calibration.path, 0, "covariance_factor", "names of parameters of this file", name);
    }
  }
  const Linearised lin = linearised(estimate, model, rows, unknowns);
  if (static_cast<std::size_t>(covariance.factor.rows()) != unknowns.count())
    return lin.residual.squaredNorm();
  const Eigen::VectorXd units = units_of(unknowns, estimate.set);
  const Eigen::MatrixXd a = product(lin.derivative, units.cwiseInverse().asDiagonal() * covariance.columns());
  const Eigen::VectorXd ar = a.transpose() * lin.residual;
  const Eigen::MatrixXd inner = Eigen::MatrixXd::Identity(a.cols(), a.cols()) + gram(a);
  return lin.residual.squaredNorm() - ar.dot(Llt(inner).solve(ar));
}

}  // namespace

std::vector<RowResidual> residuals_with(const Robot& robot, const Calibration& calibration,
                                        const std::vector<Observation>& rows) {
  return residuals(estimate_of(calibration), robot, rows, calibration.path);
}

ErrorStatistics errors_of_corrected(const Robot& robot, const Calibration& calibration,
                                    const std::vector<Observation>& rows) {
  Estimate frames = estimate_of(calibration);
  frames.set = TermSet();
  return statistics(residuals(frames, robot, rows, robot.path), rows);
}

Validation validate(const Robot& robot, const Calibration& calibration, const std::vector<Observation>& rows,
                    const std::string& source) {
  Validation out;
  Estimate fitted;
  out.before = errors_before(robot, rows, &fitted);
  if (!calibration.frames) fitted = Estimate();
  out.nominal = residuals(fitted, robot, rows, robot.path);

  const Estimate estimate = estimate_of(calibration);
  const auto model = prepare(estimate.set, robot, calibration.path);
  out.residuals = residuals(estimate, *model, rows);
  out.after = statistics(out.residuals, rows);
  out.chi2 = calibration.covariance ? chi_square_with_uncertainty(estimate, *model, rows, calibration, robot)
                                    : chi_square(out.residuals, rows);
  out.degrees_of_freedom = measured_numbers(rows);

  const ErrorStatistics& before =
      calibration.frames && out.before.fitted_frames ? *out.before.fitted_frames : out.before.nominal_frames;
  if (!(out.after.mean_m < before.mean_m)) {
    out.doubts.push_back(
        fmt::format("the mean error on {} is {:.4f} mm after and {:.4f} mm before: nothing was gained",
                    source, out.after.mean_m * 1e3, before.mean_m * 1e3));
  }
  if (!chi_square_is_usual(out.chi2, out.degrees_of_freedom)) {
    const bool above = out.chi2_per_dof() > 1;
    out.doubts.push_back(
        fmt::format("chi-square per degree of freedom is {:.3g}, outside its 99.9 % interval around 1: {}",
                    out.chi2_per_dof(),
                    above ? "the errors are larger than the declared noise explains (something is not "
                            "modelled, or noise: in the "
                            "robot file is too small)"
                          : "the errors are smaller than the declared noise (noise: in the robot file is too "
                            "large, or these rows "
                            "were fitted)"));
  }
  return out;
}

}  // namespace flexcomp::host
