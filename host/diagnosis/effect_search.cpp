// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/effect_search.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <set>

#include "diagnosis/refit.hpp"
#include "measurement/repeats.hpp"
#include "model/covariate.hpp"
#include "model/place.hpp"

namespace flexcomp::host {

namespace {

/// What an effect must gain beyond what its parameters cost: as decisive against nothing as against another name.
constexpr double margin = least_gain;
constexpr std::size_t most_effects = 8;

/// Splines per turn of a local fault of any shape, and how large its coefficients are.
constexpr std::size_t finest_local = 96;
constexpr double deep_fault_rad = 5e-4;

bool is_function(const Block& b) { return b.id.effect == Effect::unnamed; }
bool is_step(const EffectId& id) { return descriptor(id.effect).has(Selector::after); }

Block local_block(const LocalCurve& c, std::size_t index) {
  Block block;
  block.id = EffectId{.effect = Effect::joint_curve, .joint = c.joint, .coefficients = c.knots};
  // Size and centre; the few widths are not worth another.
  block.parameters = 2;
  block.margin = margin;
  block.centre_rad = c.centre_rad;
  block.width_rad = 2 * pi / static_cast<double>(c.knots);
  block.scanned = index;
  return block;
}

/// Everything that a search adds to a system while it goes on.
struct Scanned {
  std::vector<LocalCurve> locals;
  std::vector<SmoothFunction> functions;
};

void add_locals(GapSystem& system, Scanned& scanned, const std::vector<LocalCurve>& fresh,
                const std::vector<Observation>& rows) {
  for (const LocalCurve& c : fresh) {
    const bool there = std::any_of(scanned.locals.begin(), scanned.locals.end(), [&](const LocalCurve& o) {
      return o.joint == c.joint && o.knots == c.knots && std::abs(o.centre_rad - c.centre_rad) < 1e-9;
    });
    if (there) continue;
    const PlaceColumn& place = place_column(system, {static_cast<std::uint8_t>(c.joint), slot::theta});
    scanned.locals.push_back(c);
    // In the unit of curves' coefficients, 1e-4 rad.
    Block block = local_block(c, scanned.locals.size() - 1);
    add_block(system, block, times(place.column, 1e-4 * local_values(c, rows)));
    // And of any shape: a fault is no spline, and what one spline leaves of a deep one would look like something else.
    std::vector<Eigen::VectorXd> splines;
    for (std::size_t k = 0; k < finest_local; ++k) {
      const LocalCurve part{c.joint, finest_local, 2 * pi * static_cast<double>(k) / finest_local, 0};
      if (std::abs(std::remainder(part.centre_rad - c.centre_rad, 2 * pi)) < 1.5 * block.width_rad)
        splines.push_back(local_values(part, rows));
    }
    Eigen::MatrixXd columns(place.column.size(), static_cast<Eigen::Index>(splines.size()));
    for (std::size_t k = 0; k < splines.size(); ++k)
      columns.col(static_cast<Eigen::Index>(k)) = times(place.column, 1e-4 * splines[k]);
    block.parameters = 1;  // its place; the sizes by evidence
    block.precision = std::pow(1e-4 / deep_fault_rad, 2);
    add_block(system, block, columns);
  }
}

void add_function(GapSystem& system, Scanned& scanned, const SmoothFunction& f,
                  const std::vector<Variable>& variables, double cost) {
  const Eigen::MatrixXd phi = members(f, variables);
  const Eigen::VectorXd& place = place_column(system, f.place).column;
  Eigen::MatrixXd columns(place.size(), phi.cols());
  for (Eigen::Index k = 0; k < phi.cols(); ++k) columns.col(k) = times(place, f.size_rad * phi.col(k));
  Block block;
  block.id = EffectId{.effect = Effect::unnamed, .place = f.place};
  block.precision = f.bump ? 0 : 1;
  block.parameters = f.bump ? 4 : cost;  // of having tried so many functions
  block.margin = margin;
  block.function_joint = f.place.body;
  for (const std::size_t v : f.of) {
    if (variables[v].is_order) continue;
    // A bump contains nothing, but what is left of its own joint's curve looks like one.
    if (f.bump && variables[v].joint != f.place.body) continue;
    if (variables[v].kind == Covariate::joint_position) block.function_readings.push_back(variables[v].joint);
    if (variables[v].kind == Covariate::payload) block.function_load = true;
  }
  block.scanned = scanned.functions.size();
  scanned.functions.push_back(f);
  add_block(system, block, columns);
}

void add_functions(GapSystem& system, Scanned& scanned, const std::vector<SmoothFunction>& fresh,
                   const std::vector<Variable>& variables, double cost) {
  for (const SmoothFunction& f : fresh) {
    const bool there =
        std::any_of(scanned.functions.begin(), scanned.functions.end(), [&](const SmoothFunction& o) {
          return o.place == f.place && o.of == f.of && o.size_rad == f.size_rad && !o.bump && !f.bump;
        });
    if (!there) add_function(system, scanned, f, variables, cost);
  }
}

/// Of the functions that were chosen, only the members that matter, and finer ones where they do: names are decided, now
/// it is prediction that counts.
Scored with_relevant_members(GapSystem& system, SubsetSearch& search, Scanned& scanned, Scored best,
                             const std::vector<Variable>& variables) {
  const Subset chosen = best.blocks;
  for (const std::size_t b : chosen) {
    if (!is_function(system.blocks[b]) || scanned.functions[system.blocks[b].scanned].bump) continue;
    Subset others;
    for (const std::size_t o : best.blocks) {
      if (o != b) others.push_back(o);
    }
    const double cost = system.blocks[b].parameters;
    std::optional<SmoothFunction> finest;
    double most = -std::numeric_limits<double>::infinity();
    for (const int harmonics : {2, 4}) {
      SmoothFunction f = scanned.functions[system.blocks[b].scanned];
      f.harmonics = harmonics;
      const std::size_t had = system.blocks.size();
      add_function(system, scanned, f, variables, cost);
      if (system.blocks.size() == had) continue;
      search.extend();
      const Block& whole = system.blocks.back();
      if (static_cast<Eigen::Index>(whole.columns.size()) != members(f, variables).cols()) continue;
      const auto [information, right] = search.given(others, had);
      double gain = 0;
      f.share = relevance(information, right, gain);
      if (!(gain > most)) continue;
      most = gain;
      finest = f;
    }
    if (!finest) continue;
    const std::size_t had = system.blocks.size();
    add_function(system, scanned, *finest, variables, cost);
    if (system.blocks.size() == had) continue;
    search.extend();
    others.push_back(had);
    const Scored with = search.score(others);
    if (with.gain > best.gain) best = with;
  }
  return best;
}

void add_slips(GapSystem& system, const std::vector<Slip>& found, const std::vector<Observation>& rows,
               const std::array<Eigen::VectorXd, 3>& point, std::size_t index, const Candidate& candidate) {
  for (const Slip& slip : found) {
    const bool there = std::any_of(system.blocks.begin(), system.blocks.end(), [&](const Block& b) {
      return is_step(b.id) && b.id.after_s == slip.after_s;
    });
    if (there) continue;
    Eigen::VectorXd step(static_cast<Eigen::Index>(rows.size()));
    for (std::size_t k = 0; k < rows.size(); ++k)
      step[static_cast<Eigen::Index>(k)] = rows[k].context.time_s >= slip.after_s ? 1 : 0;
    Eigen::MatrixXd columns(point[0].size(), 3);
    for (int c = 0; c < 3; ++c) columns.col(c) = times(point[static_cast<std::size_t>(c)], step);
    Block block;
    block.id = candidate.id;
    block.id.after_s = slip.after_s;
    block.candidate = index;
    block.parameters = 4;
    block.margin = margin;
    block.fitted = candidate.parameters;
    add_block(system, block, columns);
  }
}

std::vector<double> row_chi2(const Robot& robot, const std::vector<Observation>& rows,
                             const Estimate& estimate) {
  const auto model = prepare(estimate.set, robot, "diagnosis");
  std::vector<double> out;
  const std::vector<RowResidual> r = residuals(estimate, *model, rows);
  for (std::size_t k = 0; k < rows.size(); ++k) out.push_back(whitened(rows[k], r[k]).squaredNorm());
  return out;
}

std::vector<bool> in_full(const std::vector<double>& weight) {
  std::vector<bool> out;
  for (const double w : weight) out.push_back(w >= 1);
  return out;
}

}  // namespace

bool same_names(const Explanation& a, const Explanation& b) {
  if (a.pieces.size() != b.pieces.size() || a.unnamed != b.unnamed) return false;
  for (const Hypothesis& p : a.pieces) {
    if (std::none_of(b.pieces.begin(), b.pieces.end(),
                     [&](const Hypothesis& q) { return same_name(p.id, q.id); }))
      return false;
  }
  return true;
}

EffectSearch::EffectSearch(const Robot& robot, const std::vector<Observation>& rows,
                           const ContextColumns& columns, const Estimate& start, const Unknowns& fitted,
                           const std::vector<double>& weight, bool poses_scatter)
    : robot_(robot),
      rows_(rows),
      start_(start),
      fitted_(fitted),
      counts_(in_full(weight)),
      can_(testable(rows, columns)),
      candidates_(candidates(robot, rows, columns, start.set)),
      variables_(variables(rows, can_)),
      left_out_(rows),
      least_touched_(poses_scatter ? 2 : 1) {
  if (counts_.size() != rows.size()) counts_.assign(rows.size(), true);
}

Estimate EffectSearch::extended(const Estimate& nuisance, const Explanation* found) const {
  Estimate out{candidates_.set, nuisance.f, nuisance.e};
  for (std::size_t t = 0; t < start_.set.terms.size(); ++t)
    out.set.terms[t].coefficient = nuisance.set.terms[t].coefficient;
  for (std::size_t v = 0; v < start_.set.values.size(); ++v) out.set.values[v] = nuisance.set.values[v];
  if (found == nullptr) return out;
  for (const Hypothesis& piece : found->pieces) {
    if (is_step(piece.id)) continue;  // its step is not the candidates' own
    for (std::size_t k = 0; k < piece.parameters.size(); ++k)
      candidates_.parameters[piece.parameters[k]].set(out.set, piece.value[static_cast<Eigen::Index>(k)]);
  }
  return out;
}

Estimate EffectSearch::nuisance_of(const Refit& refit) const {
  Estimate out{start_.set, refit.fit.estimate.f, refit.fit.estimate.e};
  for (std::size_t t = 0; t < start_.set.terms.size(); ++t)
    out.set.terms[t].coefficient = refit.fit.estimate.set.terms[t].coefficient;
  for (std::size_t v = 0; v < start_.set.values.size(); ++v)
    out.set.values[v] = refit.fit.estimate.set.values[v];
  return out;
}

Explanation EffectSearch::search(const Estimate& at, const std::vector<bool>& counts, double noise_scale2,
                                 const Explanation* before) const {
  Explanation out;
  out.variables = variables_;
  out.system = std::make_shared<GapSystem>(gap_system(robot_, rows_, counts, at, fitted_, candidates_));
  GapSystem& system = *out.system;
  std::array<Eigen::VectorXd, 3> point;
  const auto slip = std::find_if(candidates_.list.begin(), candidates_.list.end(),
                                 [](const Candidate& c) { return c.steps; });
  const bool has_slip = slip != candidates_.list.end();
  if (has_slip) {
    Unknowns three;
    for (const std::size_t p : slip->parameters) three.parameters.push_back(candidates_.parameters[p]);
    const auto model = prepare(at.set, robot_, "diagnosis");
    const Eigen::MatrixXd columns = linearised(at, *model, rows_, three).derivative;
    for (int c = 0; c < 3; ++c) {
      point[static_cast<std::size_t>(c)] = columns.col(c);
      for (std::size_t k = 0; k < rows_.size(); ++k) {
        if (!counts[k])
          point[static_cast<std::size_t>(c)].segment<6>(6 * static_cast<Eigen::Index>(k)).setZero();
      }
    }
  }
  out.search = std::make_shared<SubsetSearch>(system, noise_scale2);
  SubsetSearch& search = *out.search;
  Scanned scanned;
  const auto scan = [&](const ResidualAnalysis& left, std::size_t per_joint) {
    add_locals(system, scanned, local_curves(system, left, rows_, per_joint, least_touched_), rows_);
    if (has_slip)
      add_slips(system, slips(system, left, rows_, point, 2), rows_, point,
                static_cast<std::size_t>(slip - candidates_.list.begin()), *slip);
    search.extend();
  };
  if (before != nullptr) {
    std::vector<LocalCurve> locals;
    for (const Hypothesis& p : before->pieces) {
      if (p.local) locals.push_back(*p.local);
    }
    add_locals(system, scanned, locals, rows_);
  }
  scan(remainder(search, search.score({})), 2);
  Scored best = search.best(most_effects);
  for (int round = 0; round < 3; ++round) {
    if (best.blocks.empty()) break;
    scan(remainder(search, best), 1);
    // Each scanned one is looked for anew with the others in place: the first look had them in the way.
    for (const std::size_t b : best.blocks) {
      if (system.blocks[b].width_rad == 0 && !is_step(system.blocks[b].id)) continue;
      Subset others;
      for (const std::size_t o : best.blocks) {
        if (o != b) others.push_back(o);
      }
      scan(remainder(search, search.score(others)), 1);
    }
    const Scored better = search.best(most_effects, {best.blocks});
    if (!(search.value(better) > search.value(best) + 1e-9)) break;
    best = better;
  }

  // Smooth functions of one and two variables, in the place of names or besides them.
  const double cost =
      2 * std::log(static_cast<double>(6 * variables_.size() * variables_.size())) / search.log_n();
  std::vector<SmoothFunction> functions =
      smooth_functions(system, remainder(search, search.score({})), variables_, 4);
  const std::vector<SmoothFunction> after_names =
      smooth_functions(system, remainder(search, best), variables_, 2);
  functions.insert(functions.end(), after_names.begin(), after_names.end());
  if (rows_.size() <= most_few_rows) {  // of many rows the smooth functions do
    for (const Subset& names : {Subset(), best.blocks}) {
      const std::vector<SmoothFunction> found =
          bumps(system, remainder(search, search.score(names)), variables_, 2);
      functions.insert(functions.end(), found.begin(), found.end());
      if (best.blocks.empty()) break;
    }
  }
  functions.erase(std::remove_if(functions.begin(), functions.end(),
                                 [](const SmoothFunction& f) { return f.gain < margin; }),
                  functions.end());
  if (!functions.empty()) {
    const std::size_t had = system.blocks.size();
    add_functions(system, scanned, functions, variables_, cost);
    search.extend();
    std::vector<Subset> starts{best.blocks};
    for (std::size_t b = had; b < system.blocks.size(); ++b) starts.push_back({b});
    best = search.best(most_effects, starts);
  }

  best = prune_by_cross_validation(search, std::move(best));
  best = with_relevant_members(system, search, scanned, std::move(best), variables_);
  out.solution = best;
  Eigen::Index from = 0;
  for (const std::size_t b : best.blocks) {
    const Block& block = system.blocks[b];
    const Eigen::Index size = static_cast<Eigen::Index>(block.columns.size());
    Hypothesis piece;
    piece.id = block.id;
    piece.value = best.solution.segment(from, size);
    if (is_function(block)) {
      piece.function = scanned.functions[block.scanned];
      piece.value *= piece.function->size_rad;
    } else if (block.width_rad > 0) {
      piece.local = scanned.locals[block.scanned];
      piece.value *= 1e-4;
    } else {
      piece.parameters = block.fitted;
      piece.first_parameter = candidates_.list[block.candidate].first;
      for (Eigen::Index k = 0; k < size; ++k)
        piece.value[k] *= unit_of(candidates_.parameters[block.fitted[static_cast<std::size_t>(k)]], at.set);
    }
    from += size;
    out.pieces.push_back(std::move(piece));
  }
  return out;
}

Scored EffectSearch::prune_by_cross_validation(const SubsetSearch& search, Scored best) const {
  const std::vector<Block>& blocks = search.system().blocks;
  std::vector<bool> allowed(blocks.size(), true);
  for (std::size_t round = 0; round < 2 * most_effects && !best.blocks.empty(); ++round) {
    const double all = left_out_.chi2_per_number(search, best);
    double least = all;
    std::optional<std::size_t> idle;
    Scored without_it;
    for (const std::size_t b : best.blocks) {
      // Of the few poses in a local fault each one left out takes most of it away.
      if (blocks[b].width_rad > 0) continue;
      Subset without;
      for (const std::size_t other : best.blocks) {
        if (other != b && (is_function(blocks[b]) || !same_name(blocks[other].id, blocks[b].id)))
          without.push_back(other);
      }
      Scored less = search.score(without);
      const double chi2 = left_out_.chi2_per_number(search, less);
      if (chi2 > least) continue;
      least = chi2;
      idle = b;
      without_it = std::move(less);
    }
    if (!idle) break;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      if (b == *idle || (!is_function(blocks[*idle]) && same_name(blocks[b].id, blocks[*idle].id)))
        allowed[b] = false;
    }
    best = round < most_effects ? search.best(most_effects, {without_it.blocks}, allowed) : without_it;
  }
  return best;
}

void EffectSearch::judge(Explanation& found) const {
  const ResidualAnalysis left = remainder(*found.search, found.solution);
  for (const Hypothesis& piece : found.pieces) {
    if (!piece.function) continue;
    found.unnamed = true;
    Misfit m;
    m.place = piece.function->place;
    m.joint = piece.function->place.body;
    for (const std::size_t v : piece.function->of) {
      m.covariates.push_back(found.variables[v].name());
      m.around_deg.emplace_back();
      if (piece.function->bump)
        m.around_deg.back() = degrees(piece.function->bump->centre_rad[m.covariates.size() - 1]);
    }
    Subset without;
    for (std::size_t k = 0; k < found.solution.blocks.size(); ++k) {
      if (&found.pieces[k] != &piece) without.push_back(found.solution.blocks[k]);
    }
    const Scored less = found.search->score(without);
    const ResidualAnalysis before = remainder(*found.search, less);
    m.explains = before.chi2() > 0 ? 1 - left.chi2() / before.chi2() : 0;
    m.p_value = std::exp(-0.5 * std::max(0.0, found.solution.gain - less.gain));
    if (!found.misfit || m.explains > found.misfit->explains) found.misfit = m;
  }
  if (found.unnamed) return;
  const double dof = found.system->numbers - left.fitted_numbers;
  const std::vector<PlaceShare> places = place_shares(*found.system, left);
  const auto worst =
      std::min_element(places.begin(), places.end(),
                       [](const PlaceShare& a, const PlaceShare& b) { return a.p_value < b.p_value; });
  const bool too_large = dof >= 1 && left.chi2() > chi2_quantile(0.9995, dof);
  // One of some fifty places, at one in a thousand.
  const bool at_a_place = worst != places.end() && worst->p_value < 1e-3 / 50;
  if (!too_large && !at_a_place) return;
  found.unnamed = true;
  Misfit m;
  if (worst != places.end()) {
    m.place = worst->place;
    m.joint = worst->place.body >= 1 && worst->place.body <= joint_count ? worst->place.body : 0;
    m.explains = worst->explains;
    m.p_value = worst->p_value;
  }
  found.misfit = m;
  found.notes.push_back(
      "what is left follows nothing that was recorded: it looks like scatter from pose to pose, beyond the "
      "declared noise");
}

Explanation EffectSearch::explain(const std::function<void(double)>& progress) const {
  // Repeats say what the noise is, where there are enough of them.
  double noise2 = 1;
  std::vector<std::string> notes;
  if (const auto pure = pure_error(rows_, 0, 0); pure && pure->dof >= 30) {
    if (pure->chi2_per_dof_whitened > chi2_quantile(0.9995, pure->dof) / pure->dof) {
      noise2 = pure->chi2_per_dof_whitened;
      notes.push_back(
          fmt::format("repeated poses scatter {:.2f} times as much as the declared noise; theirs counts",
                      std::sqrt(noise2)));
    }
  }
  // The price of the whole explanation for all rows: outliers at a fixed one.
  const auto price = [&](const Explanation& e, const Refit& refit) {
    double sum = 0;
    for (const double c : row_chi2(robot_, rows_, refit.fit.estimate))
      sum += std::min(c / noise2, outlier_price);
    return sum + (e.solution.chi2_gain - e.solution.gain) +
           margin * static_cast<double>(e.solution.blocks.size());
  };
  const Estimate at = extended(start_, nullptr);
  const auto settle = [&](std::vector<bool> counts, Refit& refit) {
    Explanation e = search(at, counts, noise2, nullptr);
    // Of many rows a few outliers more or less change no name.
    const int rounds = rows_.size() > most_few_rows ? 1 : 3;
    for (int round = 0; round < rounds; ++round) {
      refit = refit_with(robot_, rows_, start_, fitted_, e);
      const std::vector<bool> now = in_full(refit.fit.weight);
      if (now == counts) break;
      counts = now;
      e = search(at, counts, noise2, &e);
    }
    return e;
  };
  Refit refit;
  Explanation best = settle(counts_, refit);
  progress(0.5);
  double best_price = price(best, refit);
  // Rows that do not fit may be outliers, or all there is to see of an effect: a fault of a few degrees of one joint, a
  // slip of the last rows. The same search with them, and with those that one joint alone could explain.
  const std::vector<double> chi2 = row_chi2(robot_, rows_, refit.fit.estimate);
  std::vector<std::size_t> odd;
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    if (refit.fit.weight[k] < 1) odd.push_back(k);
  }
  if (!odd.empty()) {
    std::vector<std::vector<bool>> tries;
    if (rows_.size() <= most_few_rows) tries.emplace_back(rows_.size(), true);
    const GapSystem everything =
        gap_system(robot_, rows_, std::vector<bool>(rows_.size(), true), extended(nuisance_of(refit), &best),
                   fitted_, CandidateSet{candidates_.set, {}, {}, {}});
    std::vector<bool> aligned;
    std::size_t most = 0;
    const auto model = prepare(refit.fit.estimate.set, robot_, "diagnosis");
    const std::vector<RowResidual> r = residuals(refit.fit.estimate, *model, rows_);
    for (std::uint8_t joint = 1; joint <= joint_count; ++joint) {
      const Eigen::VectorXd& u = place_column(everything, {joint, slot::theta}).column;
      std::vector<bool> counts = in_full(refit.fit.weight);
      std::size_t count = 0;
      for (const std::size_t k : odd) {
        const Vector6<double> e = whitened(rows_[k], r[k]);
        const auto uk = u.segment<6>(6 * static_cast<Eigen::Index>(k));
        const double along = uk.squaredNorm() > 0 ? e.dot(uk) * e.dot(uk) / uk.squaredNorm() : 0;
        if (chi2[k] - along > 30) continue;
        counts[k] = true;
        ++count;
      }
      if (count > most) {
        most = count;
        aligned = counts;
      }
    }
    if (!aligned.empty()) tries.push_back(aligned);
    for (const std::vector<bool>& counts : tries) {
      Refit other_refit;
      Explanation other = settle(counts, other_refit);
      const double other_price = price(other, other_refit);
      if (other_price < best_price) {
        best = std::move(other);
        best_price = other_price;
        refit = std::move(other_refit);
      }
    }
  }
  progress(0.8);
  judge(best);
  // Where something is left its size is the noise by which names are judged.
  if (best.unnamed) {
    const ResidualAnalysis left = remainder(*best.search, best.solution);
    const double dof = best.system->numbers - left.fitted_numbers;
    const double scale2 = noise2 * left.chi2() / std::max(1.0, dof);
    if (scale2 > 1.1 * noise2) {
      best = search(at, best.system->counts, scale2, &best);
      judge(best);
      best.unnamed = true;
    }
  }
  best.notes.insert(best.notes.begin(), notes.begin(), notes.end());
  progress(1);
  return best;
}

Explanation EffectSearch::explain_again(const Refit& refit, const Explanation& found) const {
  Explanation again = search(extended(nuisance_of(refit), &found), in_full(refit.fit.weight),
                             found.search->noise_scale2(), &found);
  judge(again);
  again.notes = found.notes;
  if (found.unnamed && !again.unnamed && found.search->noise_scale2() > 1) {
    again.unnamed = true;
    again.misfit = found.misfit;
  }
  return again;
}

std::vector<Rival> rivals_of(const SubsetSearch& search, const Scored& solution, const Subset& without,
                             const EffectId& id) {
  std::vector<Rival> rivals;
  const GapSystem& system = search.system();
  const double base = search.score(without).gain;
  const std::vector<double> gains = search.extensions(without);
  for (std::size_t b = 0; b < gains.size(); ++b) {
    const Block& block = system.blocks[b];
    if (same_name(block.id, id) || is_function(block)) continue;
    const double delta = solution.gain - (base + gains[b]);
    // A rival is better than nothing.
    if (!(delta < telling_bic) || !(gains[b] > 0)) continue;
    const auto known =
        std::find_if(rivals.begin(), rivals.end(), [&](const Rival& r) { return same_name(r.id, block.id); });
    if (known == rivals.end()) {
      rivals.push_back({block.id, delta});
    } else if (delta < known->delta_bic) {
      *known = {block.id, delta};
    }
  }
  std::sort(rivals.begin(), rivals.end(),
            [](const Rival& a, const Rival& b) { return a.delta_bic < b.delta_bic; });
  return rivals;
}

Misfit misfit_of(const FoundEffect& effect, const std::vector<PlaceShare>& places) {
  Misfit m;
  const EffectId& id = effect.id;
  const EffectDescriptor& d = descriptor(id.effect);
  m.place = d.place(id);
  m.joint = d.has(Selector::link) ? id.link : is_link(m.place) ? m.place.body : 0;
  const Follows follows = d.follows(id);
  for (const unsigned joint : follows.joint) {
    if (joint != 0 || m.covariates.empty()) m.covariates.push_back(covariate_name(follows.covariate, joint));
  }
  m.around_deg.assign(m.covariates.size(), std::nullopt);
  for (const PlaceShare& p : places) {
    if (p.place == m.place) {
      m.explains = p.explains;
      m.p_value = p.p_value;
    }
  }
  return m;
}

}  // namespace flexcomp::host
