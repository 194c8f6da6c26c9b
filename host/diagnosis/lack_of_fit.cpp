// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/lack_of_fit.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/residual_analysis.hpp"
#include "identification/estimator.hpp"

namespace flexcomp::host {

namespace {

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

}  // namespace

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
    m.joint = joint_of(worst->place);
    m.explains = worst->explains;
    m.p_value = worst->p_value;
  }
  found.misfit = m;
  found.notes.push_back(
      "what is left follows nothing that was recorded: it looks like scatter from pose to pose, beyond the "
      "declared noise");
}

}  // namespace flexcomp::host
