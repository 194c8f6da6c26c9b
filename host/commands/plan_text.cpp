// SPDX-License-Identifier: Apache-2.0
#include "commands/result_text.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "named_values.hpp"

namespace flexcomp::host {

std::vector<std::string> text_lines(const PlanTask& task, const PlanResult& r, const std::string& output) {
  const PlanProblem& problem = task.problem;
  const PoseInformation& information = *problem.information;
  std::vector<std::string> lines;
  lines.push_back(fmt::format(
      "{}: {} poses of {} by {}{}; {} of {} parameters are identifiable{}", output, r.set.size(),
      task.robot.name, name_in(planning_methods, task.method), r.stopped ? ", STOPPED before the end" : "",
      information.parameters(), information.parameters_of_model(),
      information.nuisance() > 0 ? fmt::format(", beside {} frame parameters", information.nuisance()) : ""));
  const double median = r.random_median();
  lines.push_back(fmt::format(
      "  criterion {:.6g} (expected Omin {:.6g} / O1 {:.6g}); random poses: {:.6g} (median of {} sets), "
      "{:.2f} times as large",
      r.value.criterion, r.value.omin_expected, r.value.o1, median, r.random.size(),
      median / r.value.criterion));
  if (r.before) {
    lines.push_back(fmt::format("  {} alone ({} poses): criterion {:.6g} (expected Omin {:.6g} / O1 {:.6g})",
                                task.measured_file, task.known.size(), r.before->criterion,
                                r.before->omin_expected, r.before->o1));
  } else if (!task.known.empty()) {
    lines.push_back(fmt::format("  {} alone ({} poses) does not know all of these parameters",
                                task.measured_file, task.known.size()));
  }
  if (task.payload_column) {
    std::string text;
    for (std::size_t p = 0; p < r.at_payload.size(); ++p) {
      text += fmt::format("{}{} with {:g} kg", p == 0 ? "" : ", ", r.at_payload[p],
                          problem.payloads[p].payload_kg);
    }
    lines.push_back("  poses by payload: " + text);
  }
  std::string reasons;
  for (const auto& [obstruction, share] : task.obstructed)
    reasons += fmt::format("; {:.1f} % {}", 100.0 * share, name_of(obstruction));
  lines.push_back(fmt::format("  {:.1f} % of the poses within the joint limits are allowed{}",
                              100.0 * task.feasible_share, reasons));
  lines.emplace_back("  least certain (1 sigma to expect):");
  std::vector<ExpectedSigma> worst = r.sigmas;
  std::sort(worst.begin(), worst.end(),
            [](const auto& a, const auto& b) { return a.scaled_units > b.scaled_units; });
  for (std::size_t k = 0; k < std::min<std::size_t>(5, worst.size()); ++k)
    lines.push_back(fmt::format("    {:<40} {:.3g}", worst[k].name, worst[k].value));
  lines.push_back(fmt::format("  {} evaluations, {:.2f} s", r.evaluations, r.cpu_seconds));
  return lines;
}

std::vector<std::string> comparison_lines(const PlanResult& r) {
  std::vector<std::string> lines{fmt::format("  {:<18} {:>12} {:>10} {:>12} {:>10}", "method", "criterion",
                                             "/ best", "evaluations", "CPU s")};
  double best = r.value.criterion;
  for (const MethodResult& m : r.compared) best = std::min(best, m.criterion);
  for (const MethodResult& m : r.compared) {
    lines.push_back(fmt::format("  {:<18} {:>12.6g} {:>10.4f} {:>12} {:>10.2f}", m.method, m.criterion,
                                m.criterion / best, m.evaluations, m.cpu_seconds));
  }
  return lines;
}

}  // namespace flexcomp::host
