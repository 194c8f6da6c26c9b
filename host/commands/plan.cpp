// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "commands/progress_bar.hpp"
#include "commands/result_text.hpp"
#include "commands/stop_on_signal.hpp"
#include "files/cell_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "json.hpp"
#include "planning/plan_json.hpp"
#include "report/results.hpp"

namespace flexcomp::host {
namespace {

struct Plan {
  CommonOptions common;
  std::string robot;
  std::string cell;
  unsigned poses = 0;
  std::string candidates;
  std::string method;
  std::string extend;
  std::vector<double> payloads;
  std::string measure;
  std::string model = "full";
  std::string frames = "nominal";
  std::string state;
  std::string resume;
  double effort = 1;
  bool compare = false;
  bool force = false;
  std::string report;
  std::string out;

  void run() const;

 private:
  PlanSettings settings() const;
};

PlanSettings Plan::settings() const {
  PlanSettings s;
  s.poses = poses;
  s.model = model_kinds.at(model);
  s.fit_frames = frames == "fit";
  s.payloads_kg = payloads;
  s.effort = effort;
  s.seed = common.seed;
  if (!method.empty()) s.method = planning_methods.at(method);
  if (!measure.empty()) s.measure = measurement_kinds.at(measure);
  if (!candidates.empty() && s.method && moves_joints(*s.method)) {
    throw CLI::ValidationError("--method", method +
                                               " moves joints freely and cannot choose among candidates; "
                                               "exchange and detmax do");
  }
  return s;
}

void show(ProgressBar& bar, const Search& search) {
  bar.show(static_cast<std::size_t>(1000 * std::min(search.progress(), 1.0)), 1000,
           fmt::format("criterion {:.6g}", std::exp(search.best_log_fitness())));
}

void Plan::run() const {
  refuse_same_file({{"--robot", robot}, {"--cell", cell}, {"--candidates", candidates}, {"--extend", extend}},
                   {{"-o", out},
                    {"--report", report},
                    {"--state", state.empty() ? resume : state},
                    {"--json", common.json}});
  refuse_same_file({{"--resume", resume}}, {{"-o", out}, {"--report", report}, {"--json", common.json}});
  const PlanSettings chosen = settings();
  const Robot robot_file = load_robot(robot);
  std::optional<Cell> place;
  if (!cell.empty()) place = load_cell(cell);
  const auto joints_of = [&](const std::string& path) {
    return path.empty() ? std::nullopt : std::optional(load_joints(path, robot_file, {force}));
  };
  const std::optional<MeasuredData> measured = joints_of(extend);
  const PlanTask task(robot_file, place, chosen, joints_of(candidates), measured);
  common.warn(task.warnings);
  PlanResult result;
  {
    ProgressBar bar("planning", common.quiet);
    const StopOnSignal signals;
    result = find_plan(task, {resume, state}, StopOnSignal::asked, [&](const Search& at) { show(bar, at); });
  }
  save_data(out, plan_rows(task, result));
  for (const std::string& line : text_lines(task, result, out)) common.say(line);
  if (result.stopped) {
    common.say(fmt::format("stopped: the best plan so far was written{}",
                           state.empty() && resume.empty() ? "" : "; --resume goes on from there"));
  } else if (compare) {
    const StopOnSignal signals;
    std::optional<ProgressBar> bar;
    std::string of;
    result.compared = compare_methods(task, result, StopOnSignal::asked,
                                      [&](const std::string& name, const Search& search) {
                                        if (name != of) bar.emplace(of = name, common.quiet);
                                        show(*bar, search);
                                      });
    bar.reset();
    for (const std::string& line : comparison_lines(result)) common.say(line);
  }
  common.write_json(to_json(task, result, out));
  common.write_report(report, [&] { return page_of(task, result); });
}

}  // namespace

void add_plan(CLI::App& app) {
  auto [command, options] = add_command<Plan>(
      app, "plan",
      "Measurement poses from which the parameters can be known best, inside limits, collisions and beam");
  add_robot_option(command, options.robot);
  add_value(command, "--cell", options.cell, "CELL.yaml", "Tracker, obstacles and clearances of the place");
  command.add_option("--poses", options.poses, "How many poses to plan (with --extend: how many more)")
      ->check(CLI::Range(1U, 1000U))
      ->required();
  add_value(command, "--candidates", options.candidates, "P.csv",
            "Choose among these joint readings only [deg]; with a column payload_kg each has its own load");
  command
      .add_option("--method", options.method,
                  "refine: exchange, then all joints along the gradient (default); exchange (default with "
                  "--candidates); detmax; sapso")
      ->check(CLI::IsMember(planning_methods));
  add_value(command, "--extend", options.extend, "D.csv",
            "Poses that are measured already (data file or joint readings): plan the next ones");
  add_value(command, "--payloads", options.payloads, "KG,KG,…",
            "Payloads to choose from at each pose [kg], at the robot file's centre of mass")
      ->delimiter(',')
      ->check(non_negative_number());
  command
      .add_option("--measure", options.measure,
                  "What will be measured: pose, position or reflectors. Default: as in --extend, else pose")
      ->check(CLI::IsMember(measurement_kinds));
  command.add_option("--model", options.model, "What shall be identified, as for identify")
      ->check(CLI::IsMember(model_kinds))
      ->capture_default_str();
  command
      .add_option("--frames", options.frames,
                  "nominal: the instrument measures in Fb; fit: frames will be fitted and cost information")
      ->check(CLI::IsMember({"nominal", "fit"}))
      ->capture_default_str();
  command
      .add_option("--effort", options.effort,
                  "How long to search: 1 is about a second of work for refine; 10 is ten times that")
      ->check(number_between(0.001, 1e4))
      ->capture_default_str();
  add_value(command, "--state", options.state, "FILE",
            "Write the state of the search to FILE, now and then and at the end");
  add_value(command, "--resume", options.resume, "FILE",
            "Go on from a state of this very task, to the result that an unbroken search would have");
  command.add_flag(
      "--compare", options.compare,
      "Also run every method on this task, exchange with 200 restarts, and print them side by side "
      "(minutes)");
  add_value(command, "-o,--output", options.out, "PLAN.csv",
            "The plan: joint readings [deg] in the order of travel")
      ->required();
  add_value(command, "--report", options.report, "F.html", "Self-contained page of the plan");
  add_force_option(command, options.force);
  options.common.add_seed_to(command);
  options.common.add_to(command);
  command.footer(
      "Example:\n  flexcomp plan --robot tx60l.yaml --cell cell.yaml --poses 14 --payloads 0,1.108 -o "
      "plan.csv\n"
      "The criterion is expected Omin / O1 (smaller is better). Ctrl-C stops the search; the best plan so "
      "far is "
      "written.\n"
      "Then measure, add the measured columns to the file and run identify.");
}

}  // namespace flexcomp::host
