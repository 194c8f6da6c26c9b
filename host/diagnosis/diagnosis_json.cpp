// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/diagnosis_json.hpp"

#include <cmath>
#include <string>

#include "diagnosis/messages.hpp"
#include "json.hpp"
#include "model/covariate.hpp"
#include "model/place.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

const char* word(Verdict v) {
  return v == Verdict::none ? "none" : v == Verdict::named ? "named" : "unnamed";
}

Json or_null(const std::optional<double>& v) { return v ? Json(*v) : Json(); }

/// The keys that say which effect it is, as in calibration files; whole numbers without a point.
Json id_json(const EffectId& id) {
  Json j{{"effect", effect_name(id.effect)}};
  for (const Selector s : descriptor(id.effect).selectors) {
    switch (s) {
      case Selector::joint:
        j["joint"] = id.joint;
        break;
      case Selector::from:
        j["from"] = id.from;
        break;
      case Selector::link:
        if (id.link != 0) j["link"] = id.link;
        break;
      case Selector::order:
        if (id.order == std::floor(id.order)) {
          j["order"] = static_cast<long>(id.order);
        } else {
          j["order"] = id.order;
        }
        break;
      case Selector::pivot:
        j["pivot_z_mm"] = id.pivot_z_m * 1e3;
        break;
      case Selector::after:
        j["after_s"] = id.after_s;
        break;
      case Selector::factor:
        if (id.factor != Factor::one) j["factor"] = factor_name(id.factor);
        break;
      case Selector::place:
        j["place"] = place_name(id.place);
        break;
      case Selector::grid:
        j["of"] = {covariate_name(id.covariate[0], id.covariate_joint[0]),
                   covariate_name(id.covariate[1], id.covariate_joint[1])};
        break;
      case Selector::size:
        break;
    }
  }
  return j;
}

Json effect_json(const FoundEffect& e) {
  Json j = id_json(e.id);
  Json values = Json::object(), sigmas = Json::object();
  for (const KeyedCoefficients& c : by_key(e)) {
    Json value = Json::array(), sigma = Json::array();
    for (const EffectCoefficient& v : c.values) {
      value.push_back(v.value / v.unit.si_per_file_unit());
      sigma.push_back(v.sigma / v.unit.si_per_file_unit());
    }
    values[c.key] = c.list ? value : value.front();
    sigmas[c.key] = c.list ? sigma : sigma.front();
  }
  j["coefficients"] = values;
  j["sigma"] = sigmas;
  j["p_value"] = e.p_value;
  j["delta_bic"] = e.delta_bic;
  j["pushed"] = e.pushed;
  j["confounded_with"] = json_list(e.confounded_with, [](const Rival& r) {
    Json rival = id_json(r.id);
    rival["delta_bic"] = r.delta_bic;
    return rival;
  });
  j["cross_validation"] = e.cross_validation;
  j["largest_mm"] = e.largest_m * 1e3;
  j["rms_mm"] = e.rms_m * 1e3;
  return j;
}

Json where_json(const std::optional<Misfit>& where) {
  if (!where) return nullptr;
  Json around = Json::array();
  for (std::size_t k = 0; k < where->covariates.size(); ++k)
    around.push_back(k < where->around_deg.size() ? or_null(where->around_deg[k]) : Json());
  return {{"place", place_name(where->place)}, {"joint", where->joint > 0 ? Json(where->joint) : Json()},
          {"covariates", where->covariates},   {"around_deg", around},
          {"explains", where->explains},       {"p_value", where->p_value}};
}

Json remainder_json(const std::optional<Remainder>& remainder) {
  if (!remainder) return nullptr;
  return {{"curves", json_list(remainder->curves,
                               [](const CarriedCurve& c) -> Json {
                                 return {{"joint", c.joint},
                                         {"named", c.named},
                                         {"sure", c.sure},
                                         {"size_rad", c.size_rad},
                                         {"low_rad", c.span.low_rad},
                                         {"high_rad", c.span.high_rad},
                                         {"sigma_rad", c.span.sigma_rad}};
                               })},
          {"corner_per_turn", remainder->corner},
          {"gain", remainder->gain},
          {"cross_validation", remainder->cross_validation},
          {"position_noise", remainder->position_noise},
          {"orientation_noise", remainder->orientation_noise},
          {"pushed", true}};
}

Json gap_json(const ErrorStatistics& train, const ErrorStatistics* holdout) {
  Json j{{"train_rms_mm", train.rms_m * 1e3}, {"holdout_rms_mm", nullptr}, {"holdout_rms_deg", nullptr}};
  if (holdout != nullptr) {
    j["holdout_rms_mm"] = holdout->rms_m * 1e3;
    if (holdout->rms_rad) j["holdout_rms_deg"] = degrees(*holdout->rms_rad);
  }
  return j;
}

Json places_json(const std::vector<PlaceShare>& places) {
  return json_list(places, [](const PlaceShare& p) -> Json {
    return {{"place", place_name(p.place)}, {"explains", p.explains}, {"p_value", p.p_value}};
  });
}

}  // namespace

Json to_json(const Diagnosis& d, const std::vector<Observation>& rows, const std::optional<HeldOut>& holdout,
             const Robot& robot) {
  Json j{{"verdict", word(d.verdict)}, {"effects", json_list(d.effects, effect_json)}};
  j["not_testable"] = json_list(d.not_testable, [](const NotTestable& n) -> Json {
    return {{"effect", effect_name(n.effect)}, {"needs", n.needs}};
  });
  j["remainder"] = remainder_json(d.remainder);
  j["where"] = where_json(d.where);
  j["gap"] = {{"before", gap_json(d.error_before, holdout ? &holdout->before : nullptr)},
              {"after", gap_json(d.error_after, holdout ? &holdout->after : nullptr)},
              {"noise_floor_mm", d.noise_floor_m * 1e3},
              {"holdout_noise_floor_mm", holdout ? Json(holdout->noise_floor_m * 1e3) : Json()}};
  j["unnamed"] = json_list(unnamed_effects(d, robot), id_json);
  j["poses"] = rows.size();
  j["chi2_per_dof"] = {{"before", d.chi2_per_dof_before}, {"after", d.chi2_per_dof_after}};
  j["degrees_of_freedom"] = d.degrees_of_freedom_after;
  j["steps"] = json_list(d.steps, [](const DiagnosisStep& s) -> Json {
    return {{"what", s.what},
            {"train_rms_mm", s.train_rms_m * 1e3},
            {"chi2_per_dof", s.chi2_per_dof},
            {"cross_validated", s.cross_validated}};
  });
  j["places"] = places_json(d.places);
  j["places_left"] = places_json(d.places_left);
  j["dropped"] = json_list(d.dropped, name);
  j["telling_deg"] =
      json_list(d.discriminating_poses, [](const SuggestedPose& p) { return json_list(p.q_rad, degrees); });
  j["telling_payload_kg"] = json_list(d.discriminating_poses, &SuggestedPose::payload_kg);
  j["outliers"] = json_list(d.outliers, [&](std::size_t k) { return rows[k].line; });
  j["notes"] = d.notes;
  j["doubts"] = d.doubts;
  return j;
}

}  // namespace flexcomp::host
