#include "identification/validate.hpp"

#include <fmt/format.h>

namespace flexcomp::host {

Validation validate(const RobotFile& robot, const Calibration& calibration,
                    const std::vector<Observation>& rows, const std::string& source) {
  Validation out;
  Estimate fitted;
  out.before = errors_before(robot, rows, &fitted);
  if (!calibration.frames) fitted = Estimate();
  const auto nominal = prepare(TermSet(), robot, robot.path);
  out.nominal = residuals(fitted, *nominal, rows);

  Estimate estimate;
  estimate.set = calibration.terms;
  estimate.f = calibration.f();
  estimate.e = calibration.e();
  const auto model = prepare(estimate.set, robot, calibration.path);
  out.residuals = residuals(estimate, *model, rows);
  out.after = statistics(out.residuals, rows);
  out.chi2 = chi_square(out.residuals, rows);
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
