// SPDX-License-Identifier: Apache-2.0
#include "identification/identification_json.hpp"

#include "json.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

Json repeats_json(const std::optional<PureError>& e) {
  if (!e) return nullptr;
  const auto or_null = [](const std::optional<double>& v) { return v ? Json(*v) : Json(); };
  return {{"groups", e->groups},
          {"rows", e->rows},
          {"sigma_mm", e->sigma_position_m * 1e3},
          {"sigma_mm_interval95", {e->position_interval_m.low * 1e3, e->position_interval_m.high * 1e3}},
          {"sigma_deg", degrees(e->sigma_orientation_rad)},
          {"chi2_per_dof", e->chi2_per_dof_whitened},
          {"lack_of_fit_f", or_null(e->lack_of_fit_f)},
          {"lack_of_fit_p", or_null(e->lack_of_fit_p)}};
}

}  // namespace

Json to_json(const ErrorStatistics& s) {
  Json j{{"mean_mm", s.mean_m * 1e3}, {"rms_mm", s.rms_m * 1e3}, {"max_mm", s.max_m * 1e3}};
  if (s.mean_rad) j["mean_deg"] = degrees(*s.mean_rad);
  return j;
}

Json to_json(const Before& before) {
  Json j{{"nominal_frames", to_json(before.nominal_frames)}};
  if (before.fitted_frames) j["fitted_frames"] = to_json(*before.fitted_frames);
  return j;
}

Json to_json(const Identification& r, const std::vector<Observation>& rows) {
  const Identifiability& known = r.identifiability;
  const Json values = json_list(fitted_parameters(r), [](const FittedParameter& row) -> Json {
    return {{"name", row.name},         {"value", row.value},
            {"sigma", row.sigma},       {"interval95", {row.low, row.high}},
            {"at_bound", row.at_bound}, {"significant", row.significant()}};
  });
  const Json confounded = json_list(known.confounded, [](const Confounded& c) -> Json {
    return {{"parameter", c.parameter}, {"with", c.with}};
  });
  const Json cure =
      json_list(known.suggested_poses, [](const SuggestedPose& c) { return json_list(c.q_rad, degrees); });
  const Json gains = json_list(known.payload_gains, [](const PayloadGain& gain) -> Json {
    return {{"parameter", gain.parameter}, {"sigma_ratio", gain.sigma_with_both / gain.sigma}};
  });
  const Json outlier_lines = json_list(r.outliers, [&](std::size_t k) { return rows[k].line; });
  return {{"parameters", r.parameters},
          {"identifiable", r.identifiable},
          {"confounded", confounded},
          {"missing", known.missing},
          {"cure_deg", cure},
          {"cure_payload_kg", json_list(known.suggested_poses, &SuggestedPose::payload_kg)},
          {"second_payload_gains", gains},
          {"frame_parameters", r.frame_parameters},
          {"poses", rows.size()},
          {"condition", r.condition},
          {"o1", r.o1},
          {"converged", r.fit.converged},
          {"iterations", r.fit.iterations},
          {"newton_decrement", r.fit.newton_decrement},
          {"chi2_per_dof", r.fit.chi2_per_dof()},
          {"degrees_of_freedom", r.fit.degrees_of_freedom},
          {"outlier_lines", outlier_lines},
          {"pure_error", repeats_json(r.pure_error)},
          {"before", to_json(r.before)},
          {"after", to_json(r.after)},
          {"values", values}};
}

}  // namespace flexcomp::host
