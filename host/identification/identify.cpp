// SPDX-License-Identifier: Apache-2.0
#include "identification/identify.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "flexcomp/forward.hpp"
#include "identification/fitted_calibration.hpp"
#include "identification/identifiability.hpp"
#include "input_error.hpp"
#include "nearest.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

/// Position errors before calibration are 0.5 to 4 mm; per metre of reach about half a millimetre with fitted base and
/// tool (the measured UR5 and UR10: 0.5 and 0.7 mm). A hundred times that is an error of units or joints.
constexpr double usual_error_per_reach = 5e-4;
constexpr double suspicious_factor = 100;

double reach(const Robot& robot) {
  double sum = 0;
  for (const NominalLink& link : robot.nominal.links) sum += std::hypot(link.a_m, link.d_m);
  return sum;
}

/// Root mean square distance of points from their mean.
double spread(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p / static_cast<double>(points.size());
  double sum = 0;
  for (const Eigen::Vector3d& p : points)
    sum += (p - mean).squaredNorm() / static_cast<double>(points.size());
  return std::sqrt(sum);
}

/// Sets fixed parameters to their values and removes them from those to be fitted.
void fix(const std::vector<FixedParameter>& fixed, const Robot& robot, TermSet& set,
         std::vector<Parameter>& parameters) {
  for (const FixedParameter& f : fixed) {
    const auto found = std::ranges::find(parameters, f.name, &Parameter::name);
    if (found == parameters.end()) {
      std::vector<std::string> names;
      names.reserve(parameters.size());
      for (const Parameter& p : parameters) names.push_back(p.name);
      const std::string near = nearest(f.name, names);
      throw InputError("", 0, f.name, "a parameter of this model of " + robot.name,
                       near.empty() ? "none" : fmt::format("none (did you mean {}?)", near),
                       ErrorCode::fixed_parameter);
    }
    found->set(set, f.value_si);
    parameters.erase(found);
  }
}

/// B is the small transform from the constructed base frame to the robot's own; a larger one is a measurement frame F.
/// \throws InputError  a base above 20 mm or 2 degrees
void require_small_base(const Calibration& calibration, const std::string& source) {
  double shift = 0;
  double rotation = 0;
  for (const Term<double>& t : calibration.terms.terms) {
    if (t.place.body != body::base || t.basis != Basis::one) continue;
    double& largest = t.place.slot <= slot::z ? shift : rotation;
    largest = std::max(largest, std::abs(t.coefficient));
  }
  if (shift > 0.020 || rotation > radians(2)) {
    throw InputError(source, 0, "base", "a base within 20 mm and 2 degrees of the nominal one",
                     fmt::format("{:.1f} mm, {:.2f} degrees", shift * 1e3, degrees(rotation)),
                     ErrorCode::distant_base);
  }
}

/// Reasons why the result is not reliable: parameters not identifiable, no convergence, no redundancy.
std::vector<std::string> doubts_about(const Identification& result, std::size_t rows) {
  std::vector<std::string> out;
  const std::vector<std::string>& missing = result.identifiability.missing;
  if (!missing.empty()) {
    out.push_back(
        fmt::format("{} parameters are not identifiable from these {} rows, but are from random poses of the "
                    "same kind: {}",
                    missing.size(), rows, fmt::join(missing, ", ")));
  }
  if (!result.fit.converged) {
    out.push_back(fmt::format("the fit did not converge (a further step would reduce chi-square by {:.2g})",
                              result.fit.newton_decrement));
  }
  if (missing.empty() && result.fit.degrees_of_freedom < 1) {
    out.emplace_back("there are as many unknowns as measured numbers: no redundancy to check the result");
  }
  return out;
}

}  // namespace

Before errors_before(const Robot& robot, const std::vector<Observation>& rows, Estimate* fitted) {
  Before before;
  const auto model = prepare(TermSet(), robot, "nominal robot");
  before.nominal_frames = statistics(residuals(Estimate(), *model, rows), rows);
  // With fewer than four rows the 6 + 3 frame parameters fit any data.
  if (rows.size() >= 4) {
    const Estimate frames = fit_frames(TermSet(), rows, robot);
    before.fitted_frames = statistics(residuals(frames, *model, rows), rows);
    if (fitted != nullptr) *fitted = frames;
  }
  return before;
}

void require_plausible_residuals(const Robot& robot, const std::vector<Observation>& rows,
                                 const std::string& source, const Before& before) {
  const double limit = suspicious_factor * usual_error_per_reach * reach(robot);
  const double found = before.fitted_frames
                           ? std::min(before.fitted_frames->rms_m, before.nominal_frames.rms_m)
                           : before.nominal_frames.rms_m;
  if (!(found > limit)) return;
  std::vector<Eigen::Vector3d> measured;
  std::vector<Eigen::Vector3d> nominal;
  const auto model = prepare(TermSet(), robot, source);
  for (const Observation& row : rows) {
    measured.push_back(row.p_m);
    nominal.push_back(nominal_forward(*model, row.q_rad).position);
  }
  const double ratio = spread(measured) / std::max(spread(nominal), 1e-9);
  std::string suspicion = "the data belong to another arm, or joints are in another order or sign";
  if (ratio < 0.01) suspicion = "positions are in metres, not in millimetres";
  if (ratio > 100) suspicion = "positions are in micrometres, not in millimetres";
  throw InputError(source, 0, "x_mm y_mm z_mm",
                   fmt::format("residuals to the nominal {} below {:.0f} mm", robot.name, limit * 1e3),
                   fmt::format("{:.1f} mm (rms): {}?", found * 1e3, suspicion), ErrorCode::implausible_data);
}

Identification identify(const Robot& robot, const std::vector<Observation>& rows, const std::string& source,
                        const IdentifyOptions& options) {
  Identification out;
  Estimate start;
  out.before = errors_before(robot, rows, &start);
  if (!options.force) require_plausible_residuals(robot, rows, source, out.before);

  const auto nominal_model = prepare(TermSet(), robot, source);
  const bool fit_frames_too = options.frames == FrameChoice::fit ||
                              (options.frames == FrameChoice::by_distance &&
                               nominal_frames_are_off(residuals(Estimate(), *nominal_model, rows), rows));
  if (!fit_frames_too) start = Estimate();
  out.nominal = residuals(start, *nominal_model, rows);

  ParametricModel paper = paper_model(robot.nominal, options.model, !fit_frames_too);
  out.parameters = paper.parameters.size();
  start.set = paper.set;
  Unknowns all;
  if (fit_frames_too) all.frames = free_frames(rows);
  all.parameters = paper.parameters;
  fix(options.fixed, robot, start.set, all.parameters);
  all.prior = prior_knowledge(start.set, all.parameters, options.physical, options.tolerances);
  // At the nominal arm: estimated deviations would make parallel axes look separable.
  out.identifiability = analyse_identifiability(robot, rows, start, all, options.seed);
  const Unknowns& fitted = out.identifiability.fitted;
  out.frame_parameters = fitted.frames.size();
  out.identifiable = fitted.parameters.size();

  out.fit.estimate = start;
  if (fitted.count() > 0) out.fit = fit(start, fitted, rows, robot, options.estimator);

  const Eigen::VectorXd& s = out.fit.singular_values;
  if (s.size() > 0 && s[s.size() - 1] > 0) {
    out.condition = s[0] / s[s.size() - 1];
    out.o1 = std::exp(s.array().log().mean()) / std::sqrt(static_cast<double>(rows.size()));
  }

  out.residuals = residuals(out.fit.estimate, robot, rows, source);
  out.after = statistics(out.residuals, rows);
  out.outliers = out.fit.outliers();
  std::vector<Observation> inliers;
  const std::vector<bool> counts = out.fit.has_full_weight(rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (counts[k]) inliers.push_back(rows[k]);
  }
  if (fitted.count() > 0) out.pure_error = pure_error(inliers, out.fit.chi2, out.fit.degrees_of_freedom);

  out.calibration = fitted_calibration(out.fit, fitted, robot, rows);
  if (!fit_frames_too) require_small_base(out.calibration, source);
  out.calibration.confounded = out.identifiability.confounded;
  out.calibration.residuals = {{"before_mean_mm", out.before.nominal_frames.mean_m * 1e3},
                               {"after_mean_mm", out.after.mean_m * 1e3},
                               {"after_rms_mm", out.after.rms_m * 1e3},
                               {"after_max_mm", out.after.max_m * 1e3}};
  out.doubts = doubts_about(out, rows.size());
  return out;
}

std::vector<FittedParameter> fitted_parameters(const Identification& r) {
  std::vector<FittedParameter> rows;
  const Unknowns& fitted = r.identifiability.fitted;
  const Eigen::VectorXd units = units_of(fitted, r.fit.estimate.set);
  for (std::size_t p = 0; p < fitted.parameters.size(); ++p) {
    const Parameter& parameter = fitted.parameters[p];
    const double unit = parameter.si_per_file_unit();
    const Eigen::Index i = static_cast<Eigen::Index>(fitted.frames.size() + p);
    rows.push_back({parameter.name, parameter.get(r.fit.estimate.set) / unit,
                    std::sqrt(std::max(0.0, r.fit.covariance(i, i))) * units[i] / unit,
                    r.fit.interval[p].low / unit, r.fit.interval[p].high / unit, r.fit.at_bound[p]});
  }
  return rows;
}

}  // namespace flexcomp::host
