// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/fitted_model.hpp"

#include <algorithm>
#include <cmath>

#include "identification/fitted_calibration.hpp"
#include "identification/parameter_selection.hpp"
#include "model/effects.hpp"

namespace flexcomp::host {

FittedModel fit_calibration(const Calibration& calibration, const Robot& robot,
                            const std::vector<Observation>& rows, std::uint64_t seed) {
  const Estimate estimate = estimate_of(calibration);
  Unknowns all;
  if (calibration.frames) all.frames = free_frames(rows);
  const bool has_sigma = std::any_of(calibration.sigma.begin(), calibration.sigma.end(),
                                     [](double s) { return std::isfinite(s); });
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
