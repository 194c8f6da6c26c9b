// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <map>
#include <string>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "commands/result_text.hpp"
#include "errors.hpp"
#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "files/tolerance_file.hpp"
#include "identification/identification_json.hpp"
#include "json.hpp"
#include "measurement/observation.hpp"
#include "model/admission.hpp"
#include "report/results.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

const std::map<std::string, FrameChoice> frame_choices{{"nominal", FrameChoice::nominal},
                                                       {"fit", FrameChoice::fit}};

struct Identify {
  CommonOptions common;
  std::string robot;
  std::string data;
  std::string model = "full";
  std::string frames;
  std::string out;
  std::string report;
  std::vector<std::string> fix;
  std::string tolerances;
  bool force = false;
  bool plain = false;
  bool unbounded = false;

  void run() const;
};

/// `NAME` or `NAME=VALUE`, the value in the unit that the name ends with.
FixedParameter fixed_parameter(const std::string& text, const Robot& robot) {
  const std::size_t equals = text.rfind('=');
  // joint_compliance[joint=2].rad_per_nm has an equals sign of its own.
  const bool has_value = equals != std::string::npos && text.find(']', equals) == std::string::npos;
  FixedParameter fixed{has_value ? text.substr(0, equals) : text, 0};
  if (!has_value) return fixed;
  for (const Parameter& p : paper_model(robot.nominal, ModelKind::full, true).parameters) {
    if (p.name != fixed.name) continue;
    const auto value = parse_si(text.substr(equals + 1), p.unit);
    if (!value) throw InputError("--fix", 0, fixed.name, "a number", "'" + text.substr(equals + 1) + "'");
    fixed.value_si = *value;
  }
  return fixed;  // identify() refuses a name that the model does not have
}

void Identify::run() const {
  refuse_same_file({{"--robot", robot}, {"--data", data}, {"--tolerances", tolerances}},
                   {{"-o", out}, {"--report", report}, {"--json", common.json}});
  const Robot robot_file = load_robot(robot);
  const MeasuredData file = load_data(data, robot_file, {force});
  std::vector<std::string> warnings = file.warnings;
  const std::vector<Observation> rows = observe(file, robot_file, &warnings);
  IdentifyOptions options;
  options.model = model_kinds.at(model);
  if (!frames.empty()) options.frames = frame_choices.at(frames);
  options.force = force;
  options.seed = common.seed;
  options.estimator.robust = !plain;
  options.physical = !unbounded;
  for (const std::string& text : fix) options.fixed.push_back(fixed_parameter(text, robot_file));
  if (!tolerances.empty()) options.tolerances = load_tolerances(tolerances);
  const Identification r = identify(robot_file, rows, data, options);
  add_outlier_warning(warnings, data, rows, r.outliers);
  common.warn(warnings);
  refuse_inadmissible(r.calibration.terms, robot_file, out);
  save_calibration(out, r.calibration, robot_file);

  for (const std::string& line : text_lines(r, robot_file, data, rows.size(), out)) common.say(line);
  common.write_json(to_json(r, rows));
  common.write_report(report, [&] {
    return page_of(r, rows, robot_file, data, compare_models(robot_file, rows, data, options),
                   !options.fixed.empty() || !options.tolerances.empty());
  });
  if (r.doubts.empty()) return;
  throw DoubtfulResult(fmt::format("{}: not trustworthy: {}", out, doubts_text(r)),
                       r.fit.converged ? ErrorCode::none : ErrorCode::poor_fit);
}

}  // namespace

void add_identify(CLI::App& app) {
  auto [command, options] =
      add_command<Identify>(app, "identify",
                            "Parameters with uncertainty from measured poses, positions or "
                            "reflector points");
  add_robot_option(command, options.robot);
  add_value(command, "--data", options.data, "D.csv",
            "Measured data: joint readings [deg] and poses, positions or reflectors [mm]")
      ->required();
  command
      .add_option("--model", options.model,
                  "full: geometry, joint compliance and link gravity (39 parameters); geometric; no-gravity; "
                  "no-stiffness")
      ->check(CLI::IsMember(model_kinds))
      ->capture_default_str();
  command
      .add_option("--frames", options.frames,
                  "nominal: the instrument measures in Fb and the tool point is known; fit: both are "
                  "fitted. Default: "
                  "fit where the nominal frames are off by more than 20 mm or 2 degrees")
      ->check(CLI::IsMember(frame_choices));
  add_value(command, "-o,--output", options.out, "CAL.yaml", "Calibration file")->required();
  add_value(command, "--fix", options.fix, "NAME[=VALUE]",
            "Do not fit this parameter, it is known: NAME (zero) or NAME=VALUE in the unit that the name "
            "ends with; may be given again")
      ->allow_extra_args(false);
  add_value(command, "--tolerances", options.tolerances, "T.yaml",
            "How far from the drawing parameters may be, used as prior knowledge. A file with "
            "`tolerances:` and per line NAME: SIGMA, or NAME: {expected: VALUE, sigma: SIGMA}, in the unit "
            "that the name ends with; * stands for any text (link*.d_mm: 0.2)");
  command.add_flag(
      "--unbounded", options.unbounded,
      "Compliances may come out negative (default: as small as zero, with a one-sided interval)");
  command.add_flag("--plain", options.plain, "Ordinary least squares: every row has weight 1, outliers too");
  add_value(command, "--report", options.report, "F.html", "Self-contained page of the result");
  add_force_option(command, options.force);
  options.common.add_seed_to(command);
  options.common.add_to(command);
  command.footer(
      "Example:\n  flexcomp identify --robot tx60l.yaml --data measured.csv -o cal.yaml\n"
      "Exit status 5: the calibration was written, but the data know less than random poses would (the "
      "message names what is missing and poses that would identify it), or the fit did not converge.");
}

}  // namespace flexcomp::host
