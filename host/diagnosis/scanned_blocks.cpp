// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/scanned_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/spline.hpp"
#include "identification/residuals.hpp"

namespace flexcomp::host {

namespace {

/// Knots per turn of a local fault of any shape, and the prior standard deviation of its coefficients.
constexpr std::size_t finest_local = 96;
constexpr double deep_fault_rad = 5e-4;

}  // namespace

std::optional<SlipColumns> slip_columns(const Robot& robot, const std::vector<Observation>& rows,
                                        const std::vector<bool>& counts, const Estimate& at,
                                        const CandidateSet& candidates) {
  const auto slip = std::ranges::find_if(candidates.list, &Candidate::steps);
  if (slip == candidates.list.end()) return {};
  SlipColumns out;
  out.id = slip->id;
  out.candidate = static_cast<std::size_t>(slip - candidates.list.begin());
  out.parameters = slip->parameters;
  Unknowns three;
  for (const std::size_t p : out.parameters) three.parameters.push_back(candidates.parameters[p]);
  const auto model = prepare(at.set, robot, "diagnosis");
  const Eigen::MatrixXd columns = linearised(at, *model, rows, three).derivative;
  for (std::size_t c = 0; c < 3; ++c) {
    out.point[c] = columns.col(static_cast<Eigen::Index>(c));
    for (std::size_t k = 0; k < rows.size(); ++k) {
      if (!counts[k]) out.point[c].segment<6>(first_number(k)).setZero();
    }
  }
  return out;
}

void ScannedBlocks::add_local_faults(const std::vector<LocalCurve>& fresh) {
  for (const LocalCurve& c : fresh) {
    const bool there = std::ranges::any_of(locals_, [&](const LocalCurve& o) {
      return o.joint == c.joint && o.knots == c.knots && std::abs(o.centre_rad - c.centre_rad) < 1e-9;
    });
    if (there) continue;
    const Eigen::VectorXd& place = place_column(system_, {static_cast<std::uint8_t>(c.joint), slot::theta});
    Block block;
    block.id = EffectId{.effect = Effect::joint_curve, .joint = c.joint, .coefficients = c.knots};
    block.parameters = 2;  // size and centre; the few widths are not worth another
    block.margin = least_gain;
    block.centre_rad = c.centre_rad;
    block.width_rad = c.spacing_rad();
    block.scanned = locals_.size();
    locals_.push_back(c);
    add_block(system_, block, times(place, curve_unit_rad * local_values(c, rows_)));
    // And of any shape: a fault is no spline, and what one spline leaves of a deep one would look like something else.
    std::vector<Eigen::VectorXd> splines;
    for (std::size_t k = 0; k < finest_local; ++k) {
      const LocalCurve part{c.joint, finest_local, 2 * pi * static_cast<double>(k) / finest_local, 0};
      if (std::abs(angle_difference(part.centre_rad, c.centre_rad)) < 1.5 * block.width_rad)
        splines.push_back(local_values(part, rows_));
    }
    Eigen::MatrixXd columns(place.size(), static_cast<Eigen::Index>(splines.size()));
    for (std::size_t k = 0; k < splines.size(); ++k)
      columns.col(static_cast<Eigen::Index>(k)) = times(place, curve_unit_rad * splines[k]);
    block.parameters = 1;  // its place; the sizes by evidence
    block.precision = std::pow(curve_unit_rad / deep_fault_rad, 2);
    add_block(system_, block, columns);
  }
}

void ScannedBlocks::add_slips(const std::vector<Slip>& found) {
  for (const Slip& slip : found) {
    const bool there = std::ranges::any_of(
        system_.blocks, [&](const Block& b) { return is_step(b.id) && b.id.after_s == slip.after_s; });
    if (there) continue;
    Eigen::VectorXd step(static_cast<Eigen::Index>(rows_.size()));
    for (std::size_t k = 0; k < rows_.size(); ++k)
      step[static_cast<Eigen::Index>(k)] = rows_[k].context.time_s >= slip.after_s ? 1 : 0;
    Eigen::MatrixXd columns(slip_->point[0].size(), 3);
    for (int c = 0; c < 3; ++c) columns.col(c) = times(slip_->point[static_cast<std::size_t>(c)], step);
    Block block;
    block.id = slip_->id;
    block.id.after_s = slip.after_s;
    block.candidate = slip_->candidate;
    block.parameters = 4;  // three translations and the time
    block.margin = least_gain;
    block.fitted = slip_->parameters;
    add_block(system_, block, columns);
  }
}

void ScannedBlocks::scan(const ResidualAnalysis& left, std::size_t per_joint, std::size_t least_touched) {
  add_local_faults(local_curves(system_, left, rows_, per_joint, least_touched));
  if (slip_) add_slips(slips(system_, left, rows_, slip_->point, 2));
  search_.extend();
}

bool ScannedBlocks::add_function(const SmoothFunction& f, double cost) {
  const Eigen::MatrixXd phi = members(f, variables_);
  const Eigen::VectorXd& place = place_column(system_, f.place);
  Eigen::MatrixXd columns(place.size(), phi.cols());
  for (Eigen::Index k = 0; k < phi.cols(); ++k) columns.col(k) = times(place, f.size_rad * phi.col(k));
  Block block;
  block.id = EffectId{.effect = Effect::unnamed, .place = f.place};
  block.precision = f.bump ? 0 : 1;
  block.parameters = f.bump ? 4 : cost;
  block.margin = least_gain;
  block.function_joint = f.place.body;
  for (const std::size_t v : f.of) {
    const Variable& variable = variables_[v];
    if (variable.is_order) continue;
    // A bump contains nothing, but what is left of its own joint's curve looks like one.
    if (f.bump && variable.joint != f.place.body) continue;
    if (variable.kind == Covariate::joint_position) block.function_readings.push_back(variable.joint);
    if (variable.kind == Covariate::payload) block.function_load = true;
  }
  block.scanned = functions_.size();
  functions_.push_back(f);
  const std::size_t had = system_.blocks.size();
  add_block(system_, block, columns);
  return system_.blocks.size() > had;
}

void ScannedBlocks::add_functions(const std::vector<SmoothFunction>& fresh, double cost) {
  for (const SmoothFunction& f : fresh) {
    const bool there = std::ranges::any_of(functions_, [&](const SmoothFunction& o) {
      return o.place == f.place && o.of == f.of && o.size_rad == f.size_rad && !o.bump && !f.bump;
    });
    if (!there) add_function(f, cost);
  }
  search_.extend();
}

std::optional<SmoothFunction> ScannedBlocks::relevant_members(const SmoothFunction& function,
                                                              const Subset& others, double cost) {
  std::optional<SmoothFunction> finest;
  double most = -std::numeric_limits<double>::infinity();
  for (const int harmonics : {2, 4}) {
    SmoothFunction f = function;
    f.harmonics = harmonics;
    if (!add_function(f, cost)) continue;
    search_.extend();
    const std::size_t whole = system_.blocks.size() - 1;
    if (static_cast<Eigen::Index>(system_.blocks[whole].columns.size()) != members(f, variables_).cols())
      continue;
    const auto [information, right] = search_.given(others, whole);
    double gain = 0;
    f.share = relevance(information, right, gain);
    if (!(gain > most)) continue;
    most = gain;
    finest = f;
  }
  return finest;
}

Scored ScannedBlocks::with_relevant_members(Scored best) {
  const Subset chosen = best.blocks;
  for (const std::size_t b : chosen) {
    if (!system_.blocks[b].is_function()) continue;
    const SmoothFunction whole = function(system_.blocks[b]);
    if (whole.bump) continue;
    Subset others = without(best.blocks, b);
    const double cost = system_.blocks[b].parameters;
    const std::optional<SmoothFunction> finest = relevant_members(whole, others, cost);
    if (!finest || !add_function(*finest, cost)) continue;
    search_.extend();
    others.push_back(system_.blocks.size() - 1);
    const Scored with = search_.score(others);
    if (with.gain > best.gain) best = with;
  }
  return best;
}

}  // namespace flexcomp::host
