// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/refit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "flexcomp/forward.hpp"

#include "identification/fitted_calibration.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {

namespace {

/// A curve's coefficients before anything is known of them, rad: a few times what bad gears have.
constexpr double wide_curve_rad = 1e-3;

/// What the pieces say of one joint's curve.
struct CurveParts {
  std::size_t size = 0;
  bool whole = false;  ///< a smooth curve: every coefficient is free
  std::vector<const LocalCurve*> locals;
};

bool is_free(const CurveParts& parts, std::size_t coefficient) {
  if (parts.whole) return true;
  const double at = 2 * pi * static_cast<double>(coefficient) / static_cast<double>(parts.size);
  return std::any_of(parts.locals.begin(), parts.locals.end(), [&](const LocalCurve* c) {
    // All whose knot lies in the inner half of the spline's support.
    return std::abs(std::remainder(at - c->centre_rad, 2 * pi)) <
           1.5 * 2 * pi / static_cast<double>(c->knots);
  });
}

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Fine positions along one side of a grid, and the node values of the broken line that comes closest to values there.
struct Between {
  explicit Between(const std::vector<double>& nodes) {
    constexpr Eigen::Index steps = 8;
    const Eigen::Index cells = static_cast<Eigen::Index>(nodes.size()) - 1;
    at.resize(cells * steps + 1);
    Eigen::MatrixXd hats = Eigen::MatrixXd::Zero(at.size(), cells + 1);
    for (Eigen::Index k = 0; k < at.size(); ++k) {
      const Eigen::Index cell = std::min(k / steps, cells - 1);
      const double share = static_cast<double>(k - cell * steps) / steps;
      const auto from = static_cast<std::size_t>(cell);
      at[k] = nodes[from] + share * (nodes[from + 1] - nodes[from]);
      hats(k, cell) = 1 - share;
      hats(k, cell + 1) = share;
    }
    nearest = Llt(hats.transpose() * hats).solve(Eigen::MatrixXd(hats.transpose()));
  }
  Eigen::VectorXd at;
  Eigen::MatrixXd nearest;  ///< node values = nearest * values
};

/// Nodes close together where a bump is, in every turn between low and high.
std::vector<double> nodes_of(const Bump& bump, std::size_t side, double low, double high) {
  std::vector<double> nodes{low, high};
  const double first = bump.centre_rad[side] + 2 * pi * std::floor((low - bump.centre_rad[side]) / (2 * pi));
  for (double centre = first; centre < high + 2 * pi; centre += 2 * pi) {
    for (int k = -4; k <= 4; ++k) {
      const double at = centre + 0.5 * bump.spacing_rad * k;
      if (at > low && at < high) nodes.push_back(at);
    }
  }
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end(), [](double a, double b) { return b - a < 1e-6; }),
              nodes.end());
  return nodes;
}

/// The smooth function as a table that the core reads: its values at nodes of two variables.
void add_table_of(const Hypothesis& piece, const Explanation& found, const Robot& robot,
                  ParametricModel& model) {
  constexpr std::size_t nodes = 25;
  EffectId id{.effect = Effect::unnamed};
  id.place = piece.function->place;
  std::vector<const Variable*> of;
  for (const std::size_t v : piece.function->of) of.push_back(&found.variables[v]);
  if (std::any_of(of.begin(), of.end(), [](const Variable* v) { return v->is_order; })) return;
  for (std::size_t side = 0; side < 2; ++side) {
    if (side < of.size()) {
      id.covariate[side] = of[side]->kind;
      id.covariate_joint[side] = of[side]->joint;
      const double low = of[side]->value.minCoeff();
      const double high = of[side]->value.maxCoeff();
      const std::size_t count = of[side]->kind == Covariate::joint_position ? nodes : 5;
      if (piece.function->bump) {
        id.node[side] = nodes_of(*piece.function->bump, side, low, high);
        continue;
      }
      for (std::size_t k = 0; k < count; ++k)
        id.node[side].push_back(low + (high - low) * static_cast<double>(k) / static_cast<double>(count - 1));
    } else {
      // Of one variable: the same at every load.
      id.covariate[side] = Covariate::payload;
      id.node[side] = {0, 1};
    }
  }
  add_effect(model, id, robot.nominal);
  const Term<double>& term = model.set.terms.back();
  double* values =
      model.set.values.data() + model.set.tables[term.table].offset + id.node[0].size() + id.node[1].size();
  // Not the function's values at the nodes, but those whose straight lines between them come closest to it.
  const std::array<Between, 2> between{Between(id.node[0]), Between(id.node[1])};
  const Eigen::Index rows = between[0].at.size();
  const Eigen::Index columns = between[1].at.size();
  std::vector<Eigen::VectorXd> at(of.size(), Eigen::VectorXd(rows * columns));
  for (Eigen::Index r = 0; r < rows; ++r) {
    for (Eigen::Index c = 0; c < columns; ++c) {
      at[0][r * columns + c] = between[0].at[r];
      if (at.size() > 1) at[1][r * columns + c] = between[1].at[c];
    }
  }
  const Eigen::MatrixXd phi = members(*piece.function, found.variables, at);
  // Columns that the projection took away have no coefficient: then the numbers differ, and the function is as it was.
  if (phi.cols() != piece.value.size()) return;
  const Eigen::VectorXd v = phi * piece.value;
  const Eigen::Map<const RowMajor> fine(v.data(), rows, columns);
  const RowMajor coarse = between[0].nearest * fine * between[1].nearest.transpose();
  for (Eigen::Index k = 0; k < coarse.size(); ++k) values[k] = coarse.data()[k];
}

/// Turns a curve's mean over the readings that occur into the offset of its joint: the pose stays what it is.
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

}  // namespace

Refit refit_with(const Robot& robot, const std::vector<Observation>& rows, const Estimate& start,
                 const Unknowns& fitted, const Explanation& found) {
  Refit out;
  ParametricModel model;
  model.set = start.set;
  out.start_terms = start.set.terms.size();
  out.fitted = fitted;
  out.fitted.prior.resize(fitted.parameters.size());
  const auto move_too = [&](const Parameter& p, const PriorKnowledge& prior) {
    out.fitted.parameters.push_back(p);
    out.fitted.prior.push_back(prior);
  };

  std::map<unsigned, CurveParts> curves;
  for (const Hypothesis& piece : found.pieces) {
    if (piece.id.effect != Effect::joint_curve) continue;
    CurveParts& parts = curves[piece.id.joint];
    if (piece.local) {
      parts.locals.push_back(&*piece.local);
      parts.size = std::max({parts.size, std::size_t{72}, piece.local->knots});
    } else {
      parts.whole = true;
      parts.size = std::max(parts.size, piece.id.coefficients);
    }
  }
  std::vector<std::size_t> curve_terms;
  std::vector<std::pair<std::size_t, std::size_t>> curve_ranges;  // of fitted.parameters
  for (const auto& [joint, parts] : curves) {
    const EffectId id{.effect = Effect::joint_curve, .joint = joint, .coefficients = parts.size};
    const std::size_t first = model.parameters.size();
    add_effect(model, id, robot.nominal);
    curve_terms.push_back(model.set.terms.size() - 1);
    const std::size_t from = out.fitted.parameters.size();
    for (std::size_t k = 0; k < parts.size; ++k) {
      PriorKnowledge prior;
      prior.tolerance = wide_curve_rad;
      if (is_free(parts, k)) move_too(model.parameters[first + k], prior);
    }
    curve_ranges.emplace_back(from, out.fitted.parameters.size());
  }
  for (const Hypothesis& piece : found.pieces) {
    if (piece.id.effect == Effect::joint_curve) continue;
    if (piece.function) {
      add_table_of(piece, found, robot, model);
      continue;
    }
    const std::size_t first = model.parameters.size();
    add_effect(model, piece.id, robot.nominal);
    std::vector<bool> free(model.parameters.size() - first, false);
    for (const std::size_t p : piece.parameters) free[p - piece.first_parameter] = true;
    for (std::size_t k = first; k < model.parameters.size(); ++k) {
      if (!free[k - first]) continue;
      PriorKnowledge prior;
      const EffectDescriptor& d = descriptor(piece.id.effect);
      if (d.is_nonnegative) prior.least = 0;
      // No effect is a hundred times its usual size: where only a part of it is known, the rest stays small.
      if (!d.in_paper_model) prior.tolerance = 100 * unit_of(model.parameters[k], model.set);
      move_too(model.parameters[k], prior);
    }
  }

  Estimate estimate{model.set, start.f, start.e};
  EstimatorOptions options;
  options.spectrum = false;
  // On the way to a curve's prior no more than near the minimum.
  if (!curve_ranges.empty()) options.largest_iterations = 8;
  out.fit = fit(estimate, out.fitted, rows, robot, options);
  // Empirical Bayes: the coefficients of a curve are as large as they turn out to be.
  for (int round = 0; round < 2 && !curve_ranges.empty(); ++round) {
    for (const auto& [from, to] : curve_ranges) {
      if (to - from < 4) continue;
      double square = 0;
      for (std::size_t p = from; p < to; ++p) {
        const Eigen::Index i = static_cast<Eigen::Index>(out.fitted.frames.size() + p);
        const double unit = unit_of(out.fitted.parameters[p], out.fit.estimate.set);
        square += std::pow(out.fitted.parameters[p].get(out.fit.estimate.set), 2) +
                  out.fit.covariance(i, i) * unit * unit;
      }
      const double size =
          std::clamp(std::sqrt(square / static_cast<double>(to - from)), 1e-6, wide_curve_rad);
      for (std::size_t p = from; p < to; ++p) out.fitted.prior[p].tolerance = size;
    }
    if (round == 1) options.largest_iterations = EstimatorOptions().largest_iterations;
    out.fit = fit(out.fit.estimate, out.fitted, rows, robot, options);
  }
  for (const std::size_t t : curve_terms) {
    const Term<double> term = out.fit.estimate.set.terms[t];
    centre_curve(out.fit.estimate.set, term, robot);
  }
  out.calibration = fitted_calibration(out.fit, out.fitted, robot);
  return out;
}

void describe(FoundEffect& effect, const Refit& refit, const Robot& robot,
              const std::vector<Observation>& rows, const Eigen::MatrixXd& nuisance) {
  const TermSet& set = refit.fit.estimate.set;
  for (EffectGroup& group : effects_of(set, robot.nominal)) {
    if (!same_name(group.id, effect.id)) continue;
    effect.id = group.id;
    Estimate without = refit.fit.estimate;
    for (const Parameter& p : group.parameters) {
      EffectCoefficient c;
      c.key = p.name.substr(p.name.rfind('.') + 1);
      c.unit = p.unit;
      c.value = p.get(set);
      c.sigma = std::nan("");
      for (std::size_t k = 0; k < refit.fitted.parameters.size(); ++k) {
        if (refit.fitted.parameters[k].name != p.name) continue;
        const Eigen::Index i = static_cast<Eigen::Index>(refit.fitted.frames.size() + k);
        c.sigma = std::sqrt(std::max(0.0, refit.fit.covariance(i, i))) * unit_of(p, set);
      }
      effect.coefficients.push_back(c);
      p.set(without.set, 0);
    }
    const auto with_model = prepare(set, robot, "diagnosis");
    const auto without_model = prepare(without.set, robot, "diagnosis");
    const std::vector<RowResidual> a = residuals(refit.fit.estimate, *with_model, rows);
    const std::vector<RowResidual> b = residuals(without, *without_model, rows);
    Eigen::VectorXd shift(6 * static_cast<Eigen::Index>(rows.size()));
    for (std::size_t k = 0; k < rows.size(); ++k) {
      shift.segment<6>(6 * static_cast<Eigen::Index>(k)) =
          whitened(rows[k], {a[k].position_m - b[k].position_m, a[k].orientation_rad - b[k].orientation_rad});
    }
    // What geometry and frames would take up is theirs: an axis that tilts once a turn is largely a tilted base.
    shift -= nuisance * (nuisance.transpose() * shift);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const double moved =
          unwhitened(rows[k], shift.segment<6>(6 * static_cast<Eigen::Index>(k))).head<3>().norm();
      effect.largest_m = std::max(effect.largest_m, moved);
      effect.rms_m += moved * moved / static_cast<double>(rows.size());
    }
    effect.rms_m = std::sqrt(effect.rms_m);
    return;
  }
}

}  // namespace flexcomp::host
