// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/scatter_alternative.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <cmath>

#include "diagnosis/outlier_hypotheses.hpp"
#include "diagnosis/residual_analysis.hpp"
#include "diagnosis/scatter.hpp"
#include "model/effects/descriptor.hpp"
#include "model/place.hpp"

namespace flexcomp::host {

namespace {

std::string size_text(const Scatter& s) {
  if (place_unit(s.place).name == "mm") return fmt::format("{:.3g} mm", s.sigma * 1e3);
  return fmt::format("{:.3g} arcsec", degrees(s.sigma) * 3600);
}

/// -2 ln of the likelihood of the misfit at the start, and what the selection's parameters and outliers cost (D13),
/// against the same noise for all selections of the same rows.
double cost_of(const Selection& selection) {
  const GapSystem& system = *selection.found.system;
  const SubsetSearch& search = *selection.found.search;
  const Scored& s = selection.found.solution;
  const double scale2 = search.noise_scale2();
  const ResidualAnalysis left = residual_after(search, s);
  const auto masked = static_cast<double>(std::count(system.counts.begin(), system.counts.end(), false));
  return left.residual.squaredNorm() / scale2 + system.numbers * std::log(scale2) + (s.chi2_gain - s.gain) +
         search.margins(s.blocks) + masked * outlier_price;
}

/// The misfit and the notes of a selection under scatter.
void describe_scatter(SearchResult& found, const std::vector<Scatter>& scatter,
                      const std::vector<NotTestable>& not_testable, const std::vector<PlaceShare>& places) {
  const Scatter& most = scatter.front();
  found.unnamed = true;
  if (!found.misfit || found.misfit->covariates.empty()) {
    Misfit m;
    m.place = most.place;
    m.joint = joint_of(most.place);
    m.p_value = std::exp(-0.5 * most.gain);
    for (const PlaceShare& share : places) {
      if (share.place == m.place) m.explains = share.explains;
    }
    found.misfit = m;
  }
  found.notes.clear();
  for (const Scatter& s : scatter) {
    found.notes.push_back(fmt::format(
        "{} moves by {} (standard deviation) from pose to pose and follows nothing that was recorded",
        place_name(s.place), size_text(s)));
  }
  for (const NotTestable& n : not_testable) {
    const Needs needs = descriptor(n.effect).needs;
    if ((needs != Needs::direction && needs != Needs::moves) || n.needs.empty()) continue;
    if (most.place.slot == slot::theta)
      found.notes.push_back(fmt::format("{} would look like this; to test it record {}",
                                        effect_name(n.effect), fmt::join(n.needs, ", ")));
  }
}

}  // namespace

bool prefer_scatter(Selection& selection, const Robot& robot, const std::vector<Observation>& rows,
                    const FittedModel& start, const ContextColumns& columns,
                    const std::vector<PlaceShare>& places, const DiagnosisProgress& progress) {
  // Many rows bear a little scatter without taking it for structure, and each search takes its time.
  const bool many = rows.size() > many_rows;
  if (many && selection.found.search->noise_scale2() < 1.5) return false;
  progress("what moves from pose to pose", 0.6);
  ScatteredModel scattered = scattered_model(robot, rows, start);
  if (scattered.places.empty()) return false;
  const auto under_scatter = [&] {
    return search_and_refit(robot, scattered.rows, columns, {scattered.fit, start.fitted}, true, progress,
                            0.6);
  };
  Selection other = under_scatter();
  // The scatter was that of everything at first: what was named is no scatter, and less scatter lets more be named.
  for (int round = 0; round < (many ? 1 : 3) && !other.found.hypotheses.empty(); ++round) {
    ScatteredModel less = scattered_model(robot, rows, other.refit);
    if (less.places.empty() || less.log_determinant > 0.95 * scattered.log_determinant) break;
    EstimatorOptions options;
    options.spectrum = false;
    less.fit = fit(scattered.fit.estimate, start.fitted, less.rows, robot, options);
    scattered = std::move(less);
    other = under_scatter();
  }
  const double cost = scattered.log_determinant +
                      static_cast<double>(scattered.places.size()) * selection.found.search->log_n();
  if (cost_of(other) + cost >= cost_of(selection)) return false;
  describe_scatter(other.found, scattered.places, other.search->not_testable(), places);
  selection = std::move(other);
  return true;
}

}  // namespace flexcomp::host
