// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/refit.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "diagnosis/spline.hpp"
#include "flexcomp/forward.hpp"
#include "identification/fitted_calibration.hpp"
#include "identification/parameter_selection.hpp"
#include "linalg/decompositions.hpp"
#include "model/effects/descriptor.hpp"

namespace flexcomp::host {

namespace {

/// Prior standard deviation of a curve's coefficients at the start, rad: a few times what bad gears have.
constexpr double wide_curve_rad = 1e-3;

/// The hypotheses on one joint's curve.
struct CurveParts {
  std::size_t size = 0;
  bool whole = false;  ///< a smooth curve: every coefficient is free
  std::vector<const LocalCurve*> locals;

  bool is_local(std::size_t coefficient) const {
    const double at = 2 * pi * static_cast<double>(coefficient) / static_cast<double>(size);
    // All whose knot lies in the inner half of the spline's support.
    return std::ranges::any_of(locals, [&](const LocalCurve* c) {
      return std::abs(angle_difference(at, c->centre_rad)) < 1.5 * 2 * pi / static_cast<double>(c->knots);
    });
  }
  bool is_free(std::size_t coefficient) const { return whole || is_local(coefficient); }
};

std::map<unsigned, CurveParts> curves_by_joint(const std::vector<Hypothesis>& hypotheses) {
  std::map<unsigned, CurveParts> curves;
  for (const Hypothesis& h : hypotheses) {
    if (h.id.effect != Effect::joint_curve) continue;
    CurveParts& parts = curves[h.id.joint];
    if (h.local) {
      parts.locals.push_back(&*h.local);
      parts.size = std::max({parts.size, std::size_t{72}, h.local->knots});
    } else {
      parts.whole = true;
      parts.size = std::max(parts.size, h.id.coefficients);
    }
  }
  return curves;
}

/// The model of the start and the hypotheses, with what a fit of it moves.
struct ExtendedModel {
  ParametricModel model;
  Unknowns fitted;
  std::vector<std::size_t> curve_terms;
  std::vector<std::pair<std::size_t, std::size_t>> curve_ranges;  ///< of fitted.parameters

  void release(std::size_t parameter, const PriorKnowledge& prior) {
    fitted.parameters.push_back(model.parameters[parameter]);
    fitted.prior.push_back(prior);
  }

  /// A curve with the prior (D19), and that of local faults where there are any.
  void add_curve(unsigned joint, CurveParts parts, const CurvePrior& curves,
                 const std::vector<Observation>& rows, const Robot& robot) {
    parts.size = std::max(parts.size, curve_coefficients);
    const EffectId id{.effect = Effect::joint_curve, .joint = joint, .coefficients = parts.size};
    const std::size_t first = model.parameters.size();
    add_effect(model, id, robot.nominal);
    if (parts.whole) curve_terms.push_back(model.set.terms.size() - 1);
    const std::vector<bool> measured = measured_coefficients(rows, joint - 1, parts.size);
    Eigen::MatrixXd covariance =
        coefficient_covariance(curves.size_rad[joint - 1], curves.corner, parts.size);
    std::vector<Eigen::Index> taken;
    const std::size_t from = fitted.parameters.size();
    for (std::size_t k = 0; k < parts.size; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      if (parts.is_local(k)) covariance(i, i) += wide_curve_rad * wide_curve_rad;
      if (!measured[k] && !parts.is_free(k)) continue;
      taken.push_back(i);
      release(first + k, {});
    }
    const Eigen::MatrixXd own = covariance(taken, taken);
    fitted.groups.push_back({from, Llt(own).inverse()});
  }

  void add_curve(unsigned joint, const CurveParts& parts, const Robot& robot) {
    const EffectId id{.effect = Effect::joint_curve, .joint = joint, .coefficients = parts.size};
    const std::size_t first = model.parameters.size();
    add_effect(model, id, robot.nominal);
    curve_terms.push_back(model.set.terms.size() - 1);
    const std::size_t from = fitted.parameters.size();
    PriorKnowledge prior;
    prior.tolerance = wide_curve_rad;
    for (std::size_t k = 0; k < parts.size; ++k) {
      if (parts.is_free(k)) release(first + k, prior);
    }
    curve_ranges.emplace_back(from, fitted.parameters.size());
  }

  void add(const Hypothesis& h, const Robot& robot) {
    const std::size_t first = model.parameters.size();
    add_effect(model, h.id, robot.nominal);
    std::vector<bool> free(model.parameters.size() - first, false);
    for (const std::size_t p : h.parameters) free[p - h.first_parameter] = true;
    for (std::size_t k = first; k < model.parameters.size(); ++k) {
      if (!free[k - first]) continue;
      PriorKnowledge prior;
      const EffectDescriptor& d = descriptor(h.id.effect);
      if (d.is_nonnegative) prior.least = 0;
      // No effect is a hundred times its usual size: where only a part of it is known, the rest stays small.
      if (!d.in_paper_model) prior.tolerance = 100 * unit_of(model.parameters[k], model.set);
      release(k, prior);
    }
  }
};

ExtendedModel extended_model(const Robot& robot, const std::vector<Observation>& rows,
                             const FittedModel& start, const SearchResult& found,
                             const CurveMaximum* curves) {
  ExtendedModel out;
  out.model.set = start.fit.estimate.set;
  out.fitted = start.fitted;
  out.fitted.prior.resize(start.fitted.parameters.size());
  std::map<unsigned, CurveParts> by_joint = curves_by_joint(found.hypotheses);
  for (unsigned joint = 1; curves != nullptr && joint <= joint_count; ++joint) {
    if (curves->prior.has(joint - 1)) by_joint[joint];
  }
  for (const auto& [joint, parts] : by_joint) {
    if (curves != nullptr && curves->prior.has(joint - 1)) {
      out.add_curve(joint, parts, curves->prior, rows, robot);
    } else {
      out.add_curve(joint, parts, robot);
    }
  }
  for (const Hypothesis& h : found.hypotheses) {
    if (h.id.effect == Effect::joint_curve) continue;
    if (h.function) {
      add_smooth_table(*h.function, h.value, found.variables, robot, out.model);
    } else {
      out.add(h, robot);
    }
  }
  return out;
}

/// Sets the prior of every curve to the size of its coefficients (empirical Bayes, D16).
void adapt_curve_priors(const Fit& fit, const std::vector<std::pair<std::size_t, std::size_t>>& ranges,
                        Unknowns& fitted) {
  for (const auto& [from, to] : ranges) {
    if (to - from < 4) continue;
    double square = 0;
    for (std::size_t p = from; p < to; ++p) {
      const Eigen::Index i = static_cast<Eigen::Index>(fitted.frames.size() + p);
      const double unit = unit_of(fitted.parameters[p], fit.estimate.set);
      square += std::pow(fitted.parameters[p].get(fit.estimate.set), 2) + fit.covariance(i, i) * unit * unit;
    }
    const double size = std::clamp(std::sqrt(square / static_cast<double>(to - from)), 1e-6, wide_curve_rad);
    for (std::size_t p = from; p < to; ++p) fitted.prior[p].tolerance = size;
  }
}

/// Moves a curve's mean over the joint's range into the offset of its joint: the pose stays what it is.
void centre_curve(TermSet& set, const Term<double>& term, const Robot& robot) {
  const Table& table = set.tables[term.table];
  double* c = set.values.data() + table.offset;
  const JointLimits& limits = robot.nominal.limits[term.joint];
  double mean = 0;
  constexpr int samples = 720;
  for (int k = 0; k < samples; ++k) {
    const double q = limits.min_rad + (limits.max_rad - limits.min_rad) * (k + 0.5) / samples;
    const auto w = detail::curve_weights(q, table.size);
    for (std::size_t i = 0; i < 4; ++i) mean += w.w[i] * c[w.index[i]] / samples;
  }
  for (Term<double>& other : set.terms) {
    if (other.effect != Effect::geometric || other.place != term.place) continue;
    for (std::size_t k = 0; k < table.size; ++k) c[k] -= mean;
    other.coefficient += mean;
    return;
  }
}

/// Rows with the noise that the curves leave.
std::vector<Observation> with_noise_of(const CurveMaximum& curves, std::vector<Observation> rows) {
  for (Observation& row : rows) {
    row.whitening.topRows<3>() /= curves.position_noise;
    row.whitening.bottomRows<3>() /= curves.orientation_noise;
  }
  return rows;
}

}  // namespace

Refit refit_model(const Robot& robot, const std::vector<Observation>& declared, const FittedModel& start,
                  const SearchResult& found, const CurveMaximum* curves) {
  Refit out;
  const Estimate& at = start.fit.estimate;
  const std::vector<Observation> rescaled =
      curves != nullptr ? with_noise_of(*curves, declared) : std::vector<Observation>();
  const std::vector<Observation>& rows = curves != nullptr ? rescaled : declared;
  ExtendedModel extended = extended_model(robot, rows, start, found, curves);
  EstimatorOptions options{.spectrum = false};
  // On the way to a curve's prior no more than near the minimum.
  if (!extended.curve_ranges.empty()) options.largest_iterations = 8;
  out.fit = fit({extended.model.set, at.f, at.e}, extended.fitted, rows, robot, options);
  for (int round = 0; round < 2 && !extended.curve_ranges.empty(); ++round) {
    adapt_curve_priors(out.fit, extended.curve_ranges, extended.fitted);
    if (round == 1) options.largest_iterations = EstimatorOptions().largest_iterations;
    out.fit = fit(out.fit.estimate, extended.fitted, rows, robot, options);
  }
  for (const std::size_t t : extended.curve_terms) {
    const Term<double> term = out.fit.estimate.set.terms[t];
    centre_curve(out.fit.estimate.set, term, robot);
  }
  out.fitted = std::move(extended.fitted);
  out.calibration = fitted_calibration(out.fit, out.fitted, robot, rows);
  return out;
}

namespace {

/// Whether a term reads a curve that was fitted, named or carried: its cause is searched anew.
bool is_fitted_curve(const Term<double>& term, const Calibration& calibration) {
  if (term.effect != Effect::joint_curve || term.factor != Factor::one) return false;
  if (calibration.is_regularised(term.joint + 1U)) return true;
  const Table& table = calibration.terms.tables[term.table];
  for (std::size_t k = table.offset; k < table.offset + std::size_t{table.size}; ++k) {
    if (k < calibration.value_sigma.size() && std::isfinite(calibration.value_sigma[k])) return true;
  }
  return false;
}

Calibration without_curves(Calibration calibration) {
  const Calibration all = calibration;
  calibration.terms.terms.clear();
  calibration.sigma.clear();
  for (std::size_t t = 0; t < all.terms.terms.size(); ++t) {
    if (is_fitted_curve(all.terms.terms[t], all)) continue;
    calibration.terms.terms.push_back(all.terms.terms[t]);
    if (t < all.sigma.size()) calibration.sigma.push_back(all.sigma[t]);
  }
  calibration.regularised.clear();
  return calibration;
}

}  // namespace

bool has_fitted_curves(const Calibration& calibration) {
  return std::ranges::any_of(calibration.terms.terms,
                             [&](const Term<double>& t) { return is_fitted_curve(t, calibration); });
}

FittedModel fit_calibration(const Calibration& given, const Robot& robot,
                            const std::vector<Observation>& rows, std::uint64_t seed) {
  const Calibration calibration = without_curves(given);
  const Estimate estimate = estimate_of(calibration);
  Unknowns all;
  if (calibration.frames) all.frames = free_frames(rows);
  const bool has_sigma = std::ranges::any_of(calibration.sigma, [](double s) { return std::isfinite(s); });
  for (Parameter& p : parameters_of(calibration.terms, robot.nominal)) {
    const std::vector<double>& sigma = p.value ? calibration.value_sigma : calibration.sigma;
    const std::size_t at = p.value ? *p.value : p.terms.front();
    const bool given = has_sigma && !(at < sigma.size() && std::isfinite(sigma[at]));
    if (given || estimate.set.terms[p.terms.front()].effect == Effect::unnamed) continue;
    all.parameters.push_back(std::move(p));
  }
  all.prior = prior_knowledge(estimate.set, all.parameters, true, {});
  FittedModel out;
  out.fitted = analyse_identifiability(robot, rows, estimate, all, seed).fitted;
  out.fit = fit(estimate, out.fitted, rows, robot, {});
  return out;
}

}  // namespace flexcomp::host
