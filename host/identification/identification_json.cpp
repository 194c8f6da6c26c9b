// SPDX-License-Identifier: Apache-2.0
#include "identification/identification_json.hpp"

#include "json.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

Json confounded_json(const std::vector<Confounded>& list) {
  Json j = Json::array();
  for (const Confounded& c : list) j.push_back({{"parameter", c.parameter}, {"with", c.with}});
  return j;
}

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
  Json parameters = Json::array();
  for (const FittedParameter& row : fitted_parameters(r)) {
    parameters.push_back({{"name", row.name},
                          {"value", row.value},
                          {"sigma", row.sigma},
                          {"interval95", {row.low, row.high}},
                          {"at_bound", row.at_bound},
                          {"significant", row.significant()}});
  }
  Json cure = Json::array();
  Json cure_payload = Json::array();
  for (const SuggestedPose& c : r.identifiability.suggested_poses) {
    Json pose = Json::array();
    for (const double v : c.q_rad) pose.push_back(degrees(v));
    cure.push_back(pose);
    cure_payload.push_back(c.payload_kg);
  }
  Json gains = Json::array();
  for (const PayloadGain& gain : r.identifiability.payload_gains)
    gains.push_back({{"parameter", gain.parameter}, {"sigma_ratio", gain.sigma_with_both / gain.sigma}});
  std::vector<std::size_t> outlier_lines;
  for (const std::size_t k : r.outliers) outlier_lines.push_back(rows[k].line);
  return {{"parameters", r.parameters},
          {"identifiable", r.identifiable},
          {"confounded", confounded_json(r.identifiability.confounded)},
          {"missing", r.identifiability.missing},
          {"cure_deg", cure},
          {"cure_payload_kg", cure_payload},
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
          {"values", parameters}};
}

}  // namespace flexcomp::host
