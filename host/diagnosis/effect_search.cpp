// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/effect_search.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "diagnosis/outlier_hypotheses.hpp"
#include "measurement/repeats.hpp"

namespace flexcomp::host {

namespace {

constexpr std::size_t most_effects = 8;

/// Variance of the whitened noise: 1, or that of thirty or more repeats where they scatter more than was declared.
double noise_scale2_of(const std::vector<Observation>& rows, std::vector<std::string>& notes) {
  const auto pure = pure_error(rows, 0, 0);
  if (!pure || pure->dof < 30 ||
      !(pure->chi2_per_dof_whitened > chi2_quantile(0.9995, pure->dof) / pure->dof))
    return 1;
  notes.push_back(
      fmt::format("repeated poses scatter {:.2f} times as much as the declared noise; theirs counts",
                  std::sqrt(pure->chi2_per_dof_whitened)));
  return pure->chi2_per_dof_whitened;
}

/// Misfit that one unnamed function of the solution explains. \param left  residual of the whole solution
Misfit misfit_of_function(const SearchResult& found, std::size_t hypothesis, const ResidualAnalysis& left) {
  const SmoothFunction& function = *found.hypotheses[hypothesis].function;
  Misfit m;
  m.place = function.place;
  m.joint = function.place.body;
  for (std::size_t k = 0; k < function.of.size(); ++k) {
    m.covariates.push_back(found.variables[function.of[k]].name());
    m.around_deg.emplace_back();
    if (function.bump) m.around_deg.back() = degrees(function.bump->centre_rad[k]);
  }
  const Scored less = found.search->score(without(found.solution.blocks, found.solution.blocks[hypothesis]));
  const ResidualAnalysis before = residual_after(*found.search, less);
  m.explains = before.chi2() > 0 ? 1 - left.chi2() / before.chi2() : 0;
  m.p_value = std::exp(-0.5 * std::max(0.0, found.solution.gain - less.gain));
  return m;
}

/// Sets `unnamed` and `misfit`: of the largest unnamed function that was selected, else of a residual whose chi-square or
/// share at one place is beyond chance (D14).
void test_lack_of_fit(SearchResult& found) {
  const ResidualAnalysis left = residual_after(*found.search, found.solution);
  for (std::size_t h = 0; h < found.hypotheses.size(); ++h) {
    if (!found.hypotheses[h].function) continue;
    found.unnamed = true;
    const Misfit m = misfit_of_function(found, h, left);
    if (!found.misfit || m.explains > found.misfit->explains) found.misfit = m;
  }
  if (found.unnamed) return;
  const double dof = found.system->numbers - left.fitted_numbers;
  const std::vector<PlaceShare> places = place_shares(*found.system, left);
  const auto worst = std::ranges::min_element(places, {}, &PlaceShare::p_value);
  const bool too_large = dof >= 1 && left.chi2() > chi2_quantile(0.9995, dof);
  // One of some fifty places, at one in a thousand.
  const bool at_a_place = worst != places.end() && worst->p_value < 1e-3 / 50;
  if (!too_large && !at_a_place) return;
  found.unnamed = true;
  Misfit m;
  if (worst != places.end()) {
    m.place = worst->place;
    m.joint = joint_of(worst->place);
    m.explains = worst->explains;
    m.p_value = worst->p_value;
  }
  found.misfit = m;
  found.notes.push_back(
      "what is left follows nothing that was recorded: it looks like scatter from pose to pose, beyond the "
      "declared noise");
}

/// Whether both name the same effects.
bool same_effects(const SearchResult& a, const SearchResult& b) {
  return a.hypotheses.size() == b.hypotheses.size() && a.unnamed == b.unnamed &&
         std::ranges::all_of(a.hypotheses, [&](const Hypothesis& p) {
           return std::ranges::any_of(b.hypotheses,
                                      [&](const Hypothesis& q) { return same_name(p.id, q.id); });
         });
}

}  // namespace

EffectSearch::EffectSearch(const Robot& robot, const std::vector<Observation>& rows,
                           const ContextColumns& columns, const FittedModel& start, bool poses_scatter)
    : robot_(robot),
      rows_(rows),
      start_(start),
      candidates_(candidates(robot, rows, columns, start.fit.estimate.set)),
      variables_(variables(rows, testable(rows, columns))),
      left_out_(rows),
      least_touched_(poses_scatter ? 2 : 1) {}

Estimate EffectSearch::extended(const Estimate& nuisance, const SearchResult* found) const {
  const TermSet& own = start_.fit.estimate.set;
  Estimate out{candidates_.set, nuisance.f, nuisance.e};
  for (std::size_t t = 0; t < own.terms.size(); ++t)
    out.set.terms[t].coefficient = nuisance.set.terms[t].coefficient;
  for (std::size_t v = 0; v < own.values.size(); ++v) out.set.values[v] = nuisance.set.values[v];
  if (found == nullptr) return out;
  for (const Hypothesis& h : found->hypotheses) {
    if (is_step(h.id)) continue;  // its step is not the candidates' own
    for (std::size_t k = 0; k < h.parameters.size(); ++k)
      candidates_.parameters[h.parameters[k]].set(out.set, h.value[static_cast<Eigen::Index>(k)]);
  }
  return out;
}

SearchResult EffectSearch::search(const Estimate& at, const std::vector<bool>& counts, double noise_scale2,
                                  const SearchResult* before) const {
  SearchResult out;
  out.variables = variables_;
  out.system = std::make_shared<GapSystem>(gap_system(robot_, rows_, counts, at, start_.fitted, candidates_));
  out.search = std::make_shared<SubsetSearch>(*out.system, noise_scale2);
  SubsetSearch& search = *out.search;
  ScannedBlocks scanned(*out.system, search, rows_, variables_,
                        slip_columns(robot_, rows_, counts, at, candidates_));
  if (before != nullptr) {
    std::vector<LocalCurve> locals;
    for (const Hypothesis& h : before->hypotheses) {
      if (h.local) locals.push_back(*h.local);
    }
    scanned.add_local_faults(locals);
  }
  Scored best = select_effects(scanned, search);
  best = select_functions(*out.system, scanned, search, std::move(best));
  best = prune_by_cross_validation(search, left_out_, most_effects, std::move(best));
  out.solution = scanned.with_relevant_members(std::move(best));
  out.hypotheses = hypotheses_of(out, scanned, at);
  return out;
}

Scored EffectSearch::select_effects(ScannedBlocks& scanned, SubsetSearch& search) const {
  const std::vector<Block>& blocks = search.system().blocks;
  scanned.scan(residual_after(search, search.score({})), 2, least_touched_);
  Scored best = search.best(most_effects);
  for (int round = 0; round < 3 && !best.blocks.empty(); ++round) {
    scanned.scan(residual_after(search, best), 1, least_touched_);
    // Each scanned one is looked for anew with the others in place: the first look had them in the way.
    for (const std::size_t b : best.blocks) {
      if (!blocks[b].is_local() && !is_step(blocks[b].id)) continue;
      scanned.scan(residual_after(search, search.score(without(best.blocks, b))), 1, least_touched_);
    }
    const Scored better = search.best(most_effects, {best.blocks});
    if (!(search.value(better) > search.value(best) + 1e-9)) break;
    best = better;
  }
  return best;
}

Scored EffectSearch::select_functions(const GapSystem& system, ScannedBlocks& scanned, SubsetSearch& search,
                                      Scored best) const {
  const ResidualAnalysis whole = residual_after(search, search.score({}));
  const ResidualAnalysis left = residual_after(search, best);
  std::vector<SmoothFunction> functions = smooth_functions(system, whole, variables_, 4);
  const auto append = [&](const std::vector<SmoothFunction>& more) {
    functions.insert(functions.end(), more.begin(), more.end());
  };
  append(smooth_functions(system, left, variables_, 2));
  if (rows_.size() <= many_rows) {  // of many rows the smooth functions do
    append(bump_functions(system, whole, variables_, 2));
    if (!best.blocks.empty()) append(bump_functions(system, left, variables_, 2));
  }
  std::erase_if(functions, [](const SmoothFunction& f) { return f.gain < least_gain; });
  if (functions.empty()) return best;
  const std::size_t had = system.blocks.size();
  const double tried = static_cast<double>(6 * variables_.size() * variables_.size());
  scanned.add_functions(functions, 2 * std::log(tried) / search.log_n());
  std::vector<Subset> starts{best.blocks};
  for (std::size_t b = had; b < system.blocks.size(); ++b) starts.push_back({b});
  return search.best(most_effects, starts);
}

std::vector<Hypothesis> EffectSearch::hypotheses_of(const SearchResult& result, const ScannedBlocks& scanned,
                                                    const Estimate& at) const {
  std::vector<Hypothesis> out;
  Eigen::Index from = 0;
  for (const std::size_t b : result.solution.blocks) {
    const Block& block = result.system->blocks[b];
    const Eigen::Index size = static_cast<Eigen::Index>(block.columns.size());
    Hypothesis h;
    h.id = block.id;
    h.value = result.solution.solution.segment(from, size);
    if (block.is_function()) {
      h.function = scanned.function(block);
      h.value *= h.function->size_rad;
    } else if (block.is_local()) {
      h.local = scanned.local_fault(block);
      h.value *= curve_unit_rad;
    } else {
      h.parameters = block.fitted;
      h.first_parameter = candidates_.list[block.candidate].first;
      for (Eigen::Index k = 0; k < size; ++k)
        h.value[k] *= unit_of(candidates_.parameters[block.fitted[static_cast<std::size_t>(k)]], at.set);
    }
    from += size;
    out.push_back(std::move(h));
  }
  return out;
}

EffectSearch::Settled EffectSearch::settle(std::vector<bool> counts, double noise_scale2) const {
  const Estimate at = extended(start_.fit.estimate, nullptr);
  Settled out;
  out.found = search(at, counts, noise_scale2, nullptr);
  // Of many rows a few outliers more or less change no name.
  const int rounds = rows_.size() > many_rows ? 1 : 3;
  for (int round = 0; round < rounds; ++round) {
    out.refit = refit_model(robot_, rows_, start_, out.found);
    const std::vector<bool> now = out.refit.fit.has_full_weight(rows_.size());
    if (now == counts) break;
    counts = now;
    out.found = search(at, counts, noise_scale2, &out.found);
  }
  out.cost = cost_with_outliers(robot_, rows_, out.refit, out.found.solution, noise_scale2);
  return out;
}

SearchResult EffectSearch::run(const std::function<void(double)>& progress) const {
  std::vector<std::string> notes;
  const double noise_scale2 = noise_scale2_of(rows_, notes);
  Settled best = settle(start_.fit.has_full_weight(rows_.size()), noise_scale2);
  progress(0.5);
  if (!best.refit.fit.outliers().empty()) {
    const GapSystem everything = gap_system(robot_, rows_, std::vector<bool>(rows_.size(), true),
                                            extended(best.refit.fit.estimate, &best.found), start_.fitted);
    for (const std::vector<bool>& counts : outlier_alternatives(robot_, rows_, best.refit, everything)) {
      Settled other = settle(counts, noise_scale2);
      if (other.cost < best.cost) best = std::move(other);
    }
  }
  progress(0.8);
  SearchResult found = std::move(best.found);
  test_lack_of_fit(found);
  // Where something is left its size is the noise by which names are judged.
  if (found.unnamed) {
    const ResidualAnalysis left = residual_after(*found.search, found.solution);
    const double dof = found.system->numbers - left.fitted_numbers;
    const double wider2 = noise_scale2 * left.chi2() / std::max(1.0, dof);
    if (wider2 > 1.1 * noise_scale2) {
      found = search(extended(start_.fit.estimate, nullptr), found.system->counts, wider2, &found);
      test_lack_of_fit(found);
      found.unnamed = true;
    }
  }
  found.notes.insert(found.notes.begin(), notes.begin(), notes.end());
  progress(1);
  return found;
}

SearchResult EffectSearch::run_again(const Refit& refit, const SearchResult& found) const {
  const double noise_scale2 = found.search->noise_scale2();
  SearchResult again = search(extended(refit.fit.estimate, &found), refit.fit.has_full_weight(rows_.size()),
                              noise_scale2, &found);
  test_lack_of_fit(again);
  again.notes = found.notes;
  if (found.unnamed && !again.unnamed && noise_scale2 > 1) {
    again.unnamed = true;
    again.misfit = found.misfit;
  }
  return again;
}

Selection search_and_refit(const Robot& robot, const std::vector<Observation>& rows,
                           const ContextColumns& columns, const FittedModel& start, bool poses_scatter,
                           const DiagnosisProgress& progress, double done) {
  Selection out;
  out.rows = std::make_unique<const std::vector<Observation>>(rows);
  out.start = start;
  out.search = std::make_unique<const EffectSearch>(robot, *out.rows, columns, start, poses_scatter);
  out.found = out.search->run(
      [&](double share) { progress("searching the catalogue", done + (0.6 - done) * share); });
  progress("the model with what was found", 0.6);
  out.refit = refit_model(robot, *out.rows, start, out.found);
  // Where the search was linear the refit is not: once more from there, until the effects stay.
  for (int round = 0; round < 2 && !out.found.hypotheses.empty(); ++round) {
    SearchResult again = out.search->run_again(out.refit, out.found);
    const bool same = same_effects(out.found, again);
    out.found = std::move(again);
    if (same) break;
    out.refit = refit_model(robot, *out.rows, start, out.found);
  }
  return out;
}

}  // namespace flexcomp::host
