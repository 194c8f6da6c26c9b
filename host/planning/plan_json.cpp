// SPDX-License-Identifier: Apache-2.0
#include "planning/plan_json.hpp"

#include <cmath>

#include "json.hpp"
#include "named_values.hpp"

namespace flexcomp::host {

namespace {

Json value_json(const CriterionValue& v) {
  return {{"criterion", v.criterion}, {"o1", v.o1}, {"omin_expected", v.omin_expected}};
}

}  // namespace

Json to_json(const PlanTask& task, const PlanResult& result, const std::string& output) {
  const PoseInformation& information = *task.problem.information;
  Json j{{"poses", result.set.size()},
         {"robot", task.robot.name},
         {"method", name_in(planning_methods, task.method)},
         {"model", name_in(model_kinds, task.settings.model)},
         {"measure", name_in(measurement_kinds, task.measure)},
         {"frames", task.settings.fit_frames ? "fit" : "nominal"},
         {"seed", task.settings.seed},
         {"parameters", information.parameters_of_model()},
         {"identifiable", information.parameters()},
         {"frame_parameters", information.nuisance()}};
  j.update(value_json(result.value));
  const double median = result.random_median();
  j["random_criterion"] = std::isfinite(median) ? Json(median) : nullptr;
  j["feasible_share"] = task.feasible_share;
  j["refused"] = Json::object();
  for (const auto& [obstruction, share] : task.obstructed) j["refused"][name_of(obstruction)] = share;
  if (!task.measured_file.empty()) {
    Json& before = j["before"] = {{"poses", task.known.size()}, {"known", result.before.has_value()}};
    if (result.before) before.update(value_json(*result.before));
  }
  j["evaluations"] = result.evaluations;
  j["resumed_at"] = result.resumed_at;
  j["seconds"] = result.cpu_seconds;
  j["stopped"] = result.stopped;
  j["sigmas"] = json_list(result.sigmas, [](const ExpectedSigma& s) -> Json {
    return {{"name", s.name}, {"value", s.value}};
  });
  j["payloads"] = Json::array();
  for (std::size_t p = 0; p < result.at_payload.size(); ++p) {
    j["payloads"].push_back(
        {{"payload_kg", task.problem.payloads[p].payload_kg}, {"poses", result.at_payload[p]}});
  }
  for (const MethodResult& m : result.compared) {
    j["compared"].push_back({{"method", m.method},
                             {"criterion", m.criterion},
                             {"evaluations", m.evaluations},
                             {"seconds", m.cpu_seconds}});
  }
  j["warnings"] = task.warnings;
  j["output"] = output;
  return j;
}

}  // namespace flexcomp::host
