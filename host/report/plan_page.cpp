// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>

#include "named_values.hpp"
#include "report/results.hpp"

namespace flexcomp::host {

Page page_of(const PlanTask& task, const PlanResult& result) {
  const PlanProblem& problem = task.problem;
  Page page = titled_page("Measurement poses for " + task.robot.name, task.robot);
  page.summary = fmt::format("{} poses; random ones would be {:.2f} times as bad.", result.set.size(),
                             result.random_median() / result.value.criterion);
  if (result.stopped) page.doubts.emplace_back("The search was stopped before its end.");
  page.facts = {{"method", name_in(planning_methods, task.method)},
                {"criterion", fmt::format("{:.6g}", result.value.criterion)},
                {"random poses (median)", fmt::format("{:.6g}", result.random_median())},
                {"identifiable parameters", fmt::format("{} of {}", problem.information->parameters(),
                                                        problem.information->parameters_of_model())},
                {"measured", name_in(measurement_kinds, task.measure)},
                {"allowed within the limits", fmt::format("{:.1f} %", 100.0 * task.feasible_share)}};
  if (!task.measured_file.empty())
    page.facts.push_back({"poses measured already", fmt::format("{}", task.known.size())});
  PagePlan& plan = page.plan.emplace();
  plan.cell = task.cell;
  for (const auto& [evaluations, log_fitness] : result.history)
    plan.progress.emplace_back(static_cast<double>(evaluations), std::exp(log_fitness));
  plan.evaluations = static_cast<double>(result.evaluations);
  for (const PlannedPose& p : result.set) {
    plan.q_rad.push_back(p.q_rad);
    if (task.payload_column) plan.payload_kg.push_back(problem.payloads[p.payload].payload_kg);
  }
  for (const PlannedMeasurement& m : task.known) plan.known_q_rad.push_back(m.q_rad);
  for (std::size_t j = 0; j < joint_count; ++j)
    plan.limits_rad[j] = {problem.limits[j].min_rad, problem.limits[j].max_rad};
  for (const ExpectedSigma& s : result.sigmas) plan.expected.push_back({s.name, s.value});
  return page;
}

}  // namespace flexcomp::host
