// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "commands/progress_bar.hpp"
#include "commands/result_text.hpp"
#include "diagnosis/diagnose.hpp"
#include "diagnosis/diagnosis_json.hpp"
#include "diagnosis/held_out.hpp"
#include "diagnosis/messages.hpp"
#include "errors.hpp"
#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "json.hpp"
#include "model/admission.hpp"
#include "report/results.hpp"

namespace flexcomp::host {
namespace {

struct Diagnose {
  CommonOptions common;
  std::string robot;
  std::string calibration;
  std::string data;
  std::string holdout;
  std::string out;
  std::string plan;
  std::string report;
  bool force = false;

  void run() const;
  bool write_plan(const Diagnosis& d, const Robot& robot_file) const;
};

/// \return whether there was anything to tell apart
bool Diagnose::write_plan(const Diagnosis& d, const Robot& robot_file) const {
  if (d.discriminating_poses.empty()) return false;
  MeasuredData poses;
  poses.columns.payload_mass = true;
  for (const SuggestedPose& p : d.discriminating_poses) {
    Measurement row;
    row.context = default_context<double>(robot_file.nominal);
    row.q_rad = p.q_rad;
    row.context.payload_kg = p.payload_kg;
    poses.rows.push_back(row);
  }
  save_data(plan, poses);
  return true;
}

void Diagnose::run() const {
  refuse_same_file(
      {{"--robot", robot}, {"--calibration", calibration}, {"--data", data}, {"--holdout", holdout}},
      {{"-o", out}, {"--plan", plan}, {"--report", report}, {"--json", common.json}});
  const Robot robot_file = load_robot(robot);
  DiagnoseOptions options;
  if (!calibration.empty()) options.start = load_calibration(calibration, robot_file);
  const MeasuredData file = load_data(data, robot_file, {force});
  std::vector<std::string> warnings = file.warnings;
  const std::vector<Observation> rows = observe(file, robot_file, &warnings);
  std::vector<Observation> other_rows;
  if (!holdout.empty()) {
    const MeasuredData other = load_data(holdout, robot_file, {force});
    refuse_the_fitted(file, other);
    warnings.insert(warnings.end(), other.warnings.begin(), other.warnings.end());
    other_rows = observe(other, robot_file, &warnings);
    if (!force)
      require_plausible_residuals(robot_file, other_rows, holdout, errors_before(robot_file, other_rows));
    const std::vector<std::string> missing = missing_columns(file, other);
    if (!missing.empty()) {
      warnings.push_back(
          fmt::format("{}: has no {}, which {} has: the held-out errors are those of the defaults", holdout,
                      fmt::join(missing, ", "), data));
    }
  }
  options.columns = file.columns;
  options.force = force;
  options.seed = common.seed;
  Diagnosis d;
  {
    ProgressBar bar("diagnosing", common.quiet);
    options.progress = [&bar](const std::string& what, double share) {
      bar.show(static_cast<std::size_t>(std::lround(100 * std::min(std::max(share, 0.0), 1.0))), 100, what);
    };
    d = diagnose(robot_file, rows, data, options);
  }
  std::optional<HeldOut> others;
  if (!holdout.empty()) others = held_out(robot_file, d, other_rows, holdout, force);
  add_outlier_warning(warnings, data, rows, d.outliers);
  common.warn(warnings);
  stamp(d.after, robot_file);
  refuse_inadmissible(d.after.terms, robot_file, out);
  save_calibration(out, d.after, robot_file);
  const bool planned = !plan.empty() && write_plan(d, robot_file);

  common.say(error_sentence(d, others));
  common.say(verdict_sentence(d));
  for (const std::string& line : effect_lines(d, robot_file)) common.say(line);
  for (const std::string& line : gap_lines(d, others)) common.say(line);
  for (const std::string& note : d.notes) common.say("  note: " + note);
  common.say(fmt::format("{}: written", out));
  if (planned)
    common.say(fmt::format("{}: {} poses that tell the rivals apart", plan, d.discriminating_poses.size()));
  if (!plan.empty() && !planned) {
    common.say(fmt::format("{}: not written: {}", plan,
                           d.effects.empty() ? "nothing was found that could go by another name"
                                             : "no two names are left that further poses would tell apart"));
  }
  for (const std::string& step : next_steps(d, out, planned ? plan : "")) common.say("  next: " + step);

  common.write_json(to_json(d, rows, others, robot_file));
  common.write_report(report, [&] { return page_of(d, rows, robot_file, data, others); });
  if (!d.doubts.empty()) throw DoubtfulResult(fmt::format("{}: not trustworthy: {}", out, joined(d.doubts)));
}

}  // namespace

void add_diagnose(CLI::App& app) {
  auto [command, options] = add_command<Diagnose>(
      app, "diagnose",
      "Where model and measurement still disagree: find the missing effect, name it, add it");
  add_robot_option(command, options.robot);
  add_value(command, "--calibration", options.calibration, "CAL.yaml",
            "Where to start; without it the full model is identified first");
  add_value(command, "--data", options.data, "D.csv",
            "Measured data [deg, mm], with context where it was recorded: payload_kg, move1_deg … or dir1 …, "
            "temp_c, time_s")
      ->required();
  add_value(command, "--holdout", options.holdout, "H.csv",
            "Other measured rows: how far the gap shrinks there. Changes nothing else");
  add_value(command, "-o,--output", options.out, "CAL2.yaml", "Calibration file with what was found")
      ->required();
  add_value(command, "--plan", options.plan, "POSES.csv",
            "Where two names fit equally well: poses that would tell them apart (as plan writes them)");
  add_value(command, "--report", options.report, "F.html", "Self-contained page of the result");
  add_force_option(command, options.force);
  options.common.add_seed_to(command);
  options.common.add_to(command);
  command.footer(
      "Example:\n  flexcomp diagnose --robot tx60l.yaml --calibration cal.yaml --data measured.csv --holdout "
      "others.csv -o cal2.yaml\n"
      "Every verdict is exit status 0. Exit status 5: the files were written, but the error did not shrink "
      "or chi-square says that the noise is smaller than was declared.");
}

}  // namespace flexcomp::host
