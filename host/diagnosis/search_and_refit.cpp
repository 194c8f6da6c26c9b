// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/search_and_refit.hpp"

namespace flexcomp::host {

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
