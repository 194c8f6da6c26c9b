// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/diagnose.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "diagnosis/discriminating_poses.hpp"
#include "diagnosis/found_effects.hpp"
#include "diagnosis/remainder.hpp"
#include "diagnosis/scatter.hpp"
#include "identification/fitted_calibration.hpp"
#include "identification/identify.hpp"

namespace flexcomp::host {

namespace {

/// The calibration that is given, fitted to the rows, or the full model identified in them.
FittedModel starting_model(const Robot& robot, const std::vector<Observation>& rows,
                           const std::string& source, const DiagnoseOptions& options, Diagnosis& out) {
  if (options.start) return fit_calibration(*options.start, robot, rows, options.seed);
  Identification base = identify(robot, rows, source, {.force = options.force, .seed = options.seed});
  for (const std::string& d : base.doubts) out.doubts.push_back("the model at the start: " + d);
  out.before.confounded = base.calibration.confounded;
  return {std::move(base.fit), std::move(base.identifiability.fitted)};
}

double noise_floor(const std::vector<Observation>& rows) {
  double sum = 0;
  for (const Observation& row : rows) {
    const Eigen::Matrix3d w = row.whitening.topLeftCorner<3, 3>();
    sum += (w.transpose() * w).inverse().trace();
  }
  return rows.empty() ? 0 : std::sqrt(sum / static_cast<double>(rows.size()));
}

/// Calibrations, residuals and errors before and after, by the noise that was declared.
void compare(Diagnosis& out, const Robot& robot, const std::vector<Observation>& rows,
             const std::string& source, const FittedModel& start, const Refit& refit) {
  const std::vector<Confounded> confounded = out.before.confounded;
  out.before = fitted_calibration(start.fit, start.fitted, robot, rows);
  out.after = refit.calibration;
  out.before.confounded = out.after.confounded = confounded;
  out.noise_floor_m = noise_floor(rows);
  out.residuals_before = residuals(start.fit.estimate, robot, rows, source);
  out.residuals_after = residuals(refit.fit.estimate, robot, rows, source);
  out.error_before = statistics(out.residuals_before, rows);
  out.error_after = statistics(out.residuals_after, rows);
  out.outliers = refit.fit.outliers();
  out.chi2_per_dof_before = start.fit.chi2_per_dof();
  // Not the refit's own chi-square: its rows may have the noise of scatter besides.
  const double chi2 = chi2_of(out.residuals_after, rows, refit.fit.has_full_weight(rows.size()));
  out.chi2_per_dof_after = chi2 / std::max(1.0, refit.fit.degrees_of_freedom);
  out.degrees_of_freedom_after = refit.fit.degrees_of_freedom;
}

/// Shares of a refitted model's misfit by the noise that these rows declare.
std::vector<PlaceShare> place_shares_at(const Refit& refit, const Robot& robot,
                                        const std::vector<Observation>& rows) {
  const GapSystem system =
      gap_system(robot, rows, refit.fit.has_full_weight(rows.size()), refit.fit.estimate, refit.fitted);
  return place_shares(system, residual_after(system));
}

/// Shares of the places in what a refit leaves, curves and all, by the declared noise.
std::vector<PlaceShare> place_shares_beside_curves(const Diagnosis& d, const FittedModel& start,
                                                   const Refit& refit, const Robot& robot,
                                                   const std::vector<Observation>& rows) {
  const GapSystem system =
      gap_system(robot, rows, refit.fit.has_full_weight(rows.size()), refit.fit.estimate, start.fitted);
  Eigen::VectorXd left = whitened(d.residuals_after, rows);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (!system.counts[k]) left.segment<6>(first_number(k)).setZero();
  }
  return place_shares(system, {left, system.nuisance, system.numbers - refit.fit.degrees_of_freedom, 1});
}

/// The measured part of every carried curve; those without a name are marked in the calibration.
void describe_remainder(Diagnosis& out, const Refit& refit, const Robot& robot,
                        const std::vector<Observation>& rows) {
  const std::vector<EffectGroup> groups = effects_of(refit.fit.estimate.set, robot.nominal);
  for (CarriedCurve& curve : out.remainder->curves) {
    if (!curve.named) out.after.regularised.push_back(curve.joint);
    for (const EffectGroup& group : groups) {
      if (group.id.joint != curve.joint) continue;
      if (const auto span = curve_span(refit, group, rows)) curve.span = *span;
    }
  }
}

/// Local faults that few rows show, notes of the search, outliers.
std::vector<std::string> notes_of(const SearchResult& found, const std::vector<std::size_t>& outliers,
                                  const std::vector<Observation>& rows) {
  std::vector<std::string> notes;
  for (const Hypothesis& h : found.hypotheses) {
    if (!h.local) continue;
    const Eigen::VectorXd inside = local_values(*h.local, rows);
    std::vector<std::size_t> lines;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      if (inside[static_cast<Eigen::Index>(k)] > 0.1) lines.push_back(rows[k].line);
    }
    if (lines.size() > 3) continue;
    notes.push_back(fmt::format("{} rests on {} (line {}): measure more poses with joint {} near {:.0f} deg",
                                name(h.id),
                                lines.size() == 1 ? "one row" : fmt::format("{} rows", lines.size()),
                                fmt::join(lines, ", "), h.local->joint, degrees(h.local->centre_rad)));
  }
  notes.insert(notes.end(), found.notes.begin(), found.notes.end());
  if (!outliers.empty())
    notes.push_back(
        fmt::format("{} of {} rows are outliers and down-weighted", outliers.size(), rows.size()));
  return notes;
}

/// Why the result must not be relied on.
void add_doubts(Diagnosis& out, const Fit& fit, bool changed) {
  if (!fit.converged)
    out.doubts.push_back(
        fmt::format("the fit did not converge (a further step would still gain {:.2g} in chi-square)",
                    fit.newton_decrement));
  if (out.degrees_of_freedom_after < 1)
    out.doubts.push_back(
        "there are as many unknowns as measured numbers: no effect could show in what is left");
  // Where nothing was added a refit without the outliers may move the error a little.
  const double same = changed ? 1.0001 : 1.01;
  if ((changed || out.verdict == Verdict::unnamed) &&
      !(out.chi2_per_dof_after <= out.chi2_per_dof_before * same) &&
      !(out.error_after.rms_m < out.error_before.rms_m * (changed ? 1 : same)))
    out.doubts.push_back("the error after is not below the error before");
  if (out.verdict != Verdict::unnamed && fit.degrees_of_freedom >= 1 &&
      fit.chi2 < chi2_quantile(0.0005, fit.degrees_of_freedom)) {
    out.doubts.push_back(
        fmt::format("chi-square per degree of freedom {:.3g}: the noise is smaller than was declared",
                    fit.chi2_per_dof()));
  }
}

}  // namespace

Diagnosis diagnose(const Robot& robot, const std::vector<Observation>& rows, const std::string& source,
                   const DiagnoseOptions& options) {
  const DiagnosisProgress progress = [&](const std::string& what, double share) {
    if (options.progress) options.progress(what, share);
  };
  Diagnosis out;
  progress("the model at the start", 0);
  const FittedModel start = starting_model(robot, rows, source, options, out);

  Selection selection = search_and_refit(robot, rows, options.columns, start, false, progress, 0.1);
  const SubsetSearch& first = *selection.found.search;
  out.places = place_shares(first.system(), residual_after(first, first.score({})));
  progress("what no name explains", 0.55);
  const LeftOutPoses left_out(rows);
  out.remainder = carry_remainder(selection, robot, rows, left_out);
  const bool scatters = !out.remainder && selection.found.unnamed &&
                        prefer_scatter(selection, robot, rows, start, options.columns, out.places, progress);

  progress("how sure it is", 0.7);
  const SearchResult& found = selection.found;
  const Refit& refit = selection.refit;
  compare(out, robot, rows, source, start, refit);
  const ResidualAnalysis left = residual_after(*found.search, found.solution);
  out.places_left = scatters        ? place_shares_at(refit, robot, rows)
                    : out.remainder ? place_shares_beside_curves(out, start, refit, robot, rows)
                                    : place_shares(*found.system, left);
  out.effects = found_effects(robot, selection, left, left_out, options.seed);
  out.steps = steps_of(selection, out.effects, left_out);
  if (out.remainder) {
    describe_remainder(out, refit, robot, rows);
    out.steps.push_back({"curves that carry the rest", out.error_after.rms_m, out.chi2_per_dof_after,
                         out.remainder->cross_validated});
  }
  out.not_testable = selection.search->not_testable();
  out.dropped = found.system->dropped;

  out.verdict = found.unnamed ? Verdict::unnamed : out.effects.empty() ? Verdict::none : Verdict::named;
  out.where = found.misfit;
  if (!out.where && !out.effects.empty()) out.where = misfit_of(out.effects.front(), out.places);
  out.notes = notes_of(found, out.outliers, rows);
  if (options.start && has_fitted_curves(*options.start))
    out.notes.emplace_back(
        "the joints' curves of the calibration at the start were searched anew: before is without them");

  progress("poses that tell rivals apart", 0.9);
  out.discriminating_poses =
      discriminating_poses(robot, *selection.rows, selection.start, selection.search->candidate_set(),
                           found.hypotheses, out.effects, options.seed);
  add_doubts(out, refit.fit, !found.hypotheses.empty() || out.remainder);
  progress("done", 1);
  return out;
}

}  // namespace flexcomp::host
