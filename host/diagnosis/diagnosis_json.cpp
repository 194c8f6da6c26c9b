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
  j["confounded_with"] = Json::array();
  for (const Rival& r : e.confounded_with) {
    Json rival = id_json(r.id);
    rival["delta_bic"] = r.delta_bic;
    j["confounded_with"].push_back(rival);
  }
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

Json gap_json(const ErrorStatistics& train, const ErrorStatistics* holdout) {
  Json j{{"train_rms_mm", train.rms_m * 1e3}, {"holdout_rms_mm", nullptr}, {"holdout_rms_deg", nullptr}};
  if (holdout != nullptr) {
    j["holdout_rms_mm"] = holdout->rms_m * 1e3;
    if (holdout->rms_rad) j["holdout_rms_deg"] = degrees(*holdout->rms_rad);
  }
  return j;
}

Json places_json(const std::vector<PlaceShare>& places) {
  Json list = Json::array();
  for (const PlaceShare& p : places)
    list.push_back({{"place", place_name(p.place)}, {"explains", p.explains}, {"p_value", p.p_value}});
  return list;
}

}  // namespace

Json to_json(const Diagnosis& d, const std::vector<Observation>& rows, const std::optional<HeldOut>& holdout,
             const Robot& robot) {
  Json j{{"verdict", word(d.verdict)}, {"effects", Json::array()}, {"not_testable", Json::array()}};
  for (const FoundEffect& e : d.effects) j["effects"].push_back(effect_json(e));
  for (const NotTestable& n : d.not_testable)
    j["not_testable"].push_back({{"effect", effect_name(n.effect)}, {"needs", n.needs}});
  j["where"] = where_json(d.where);
  j["gap"] = {{"before", gap_json(d.error_before, holdout ? &holdout->before : nullptr)},
              {"after", gap_json(d.error_after, holdout ? &holdout->after : nullptr)},
              {"noise_floor_mm", d.noise_floor_m * 1e3},
              {"holdout_noise_floor_mm", holdout ? Json(holdout->noise_floor_m * 1e3) : Json()}};
  j["unnamed"] = Json::array();
  for (const EffectId& id : unnamed_effects(d, robot)) j["unnamed"].push_back(id_json(id));
  j["poses"] = rows.size();
  j["chi2_per_dof"] = {{"before", d.chi2_per_dof_before}, {"after", d.chi2_per_dof_after}};
  j["degrees_of_freedom"] = d.degrees_of_freedom_after;
  j["steps"] = Json::array();
  for (const DiagnosisStep& s : d.steps) {
    j["steps"].push_back({{"what", s.what},
                          {"train_rms_mm", s.train_rms_m * 1e3},
                          {"chi2_per_dof", s.chi2_per_dof},
                          {"cross_validated", s.cross_validated}});
  }
  j["places"] = places_json(d.places);
  j["places_left"] = places_json(d.places_left);
  j["dropped"] = Json::array();
  for (const EffectId& id : d.dropped) j["dropped"].push_back(name(id));
  j["telling_deg"] = Json::array();
  j["telling_payload_kg"] = Json::array();
  for (const SuggestedPose& p : d.discriminating_poses) {
    Json pose = Json::array();
    for (const double q : p.q_rad) pose.push_back(degrees(q));
    j["telling_deg"].push_back(pose);
    j["telling_payload_kg"].push_back(p.payload_kg);
  }
  j["outliers"] = Json::array();
  for (const std::size_t k : d.outliers) j["outliers"].push_back(rows[k].line);
  j["notes"] = d.notes;
  j["doubts"] = d.doubts;
  return j;
}

}  // namespace flexcomp::host
