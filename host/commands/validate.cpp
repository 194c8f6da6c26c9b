// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <string>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "commands/result_text.hpp"
#include "errors.hpp"
#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "identification/identification_json.hpp"
#include "identification/validate.hpp"
#include "json.hpp"
#include "measurement/observation.hpp"
#include "report/results.hpp"

namespace flexcomp::host {
namespace {

struct Validate {
  CommonOptions common;
  std::string robot;
  std::string calibration;
  std::string data;
  std::string report;
  bool corrected = false;
  bool force = false;

  void run() const;
};

void Validate::run() const {
  refuse_same_file({{"--robot", robot}, {"--calibration", calibration}, {"--data", data}},
                   {{"--report", report}, {"--json", common.json}});
  const Robot robot_file = load_robot(robot);
  const Calibration set = load_calibration(calibration, robot_file);
  const MeasuredData file = load_data(data, robot_file, {force});
  std::vector<std::string> warnings = file.warnings;
  const std::vector<Observation> rows = observe(file, robot_file, &warnings);
  common.warn(warnings);
  if (corrected) {
    const ErrorStatistics left = errors_of_corrected(robot_file, set, rows);
    common.say(fmt::format("{}: {} rows of {}, driven with commands that {} corrected", data, rows.size(),
                           robot_file.name, calibration));
    common.say(accuracy_table(left));
    common.write_json({{"corrected", to_json(left)}, {"poses", rows.size()}});
    return;
  }
  const Validation v = validate(robot_file, set, rows, data);
  common.say(fmt::format("{}: {} rows of {} with {}", data, rows.size(), robot_file.name, calibration));
  common.say(accuracy_table(v.before, v.after));
  common.say(fmt::format("  chi-square per degree of freedom {:.3g}", v.chi2_per_dof()));
  common.write_json({{"before", to_json(v.before)},
                     {"after", to_json(v.after)},
                     {"poses", rows.size()},
                     {"chi2_per_dof", v.chi2_per_dof()},
                     {"degrees_of_freedom", v.degrees_of_freedom}});
  common.write_report(report, [&] { return page_of(v, rows, robot_file, set, data); });
  if (!v.doubts.empty()) {
    throw DoubtfulResult(
        fmt::format("{}: {}", calibration, joined(v.doubts)),
        chi_square_is_usual(v.chi2, v.degrees_of_freedom) ? ErrorCode::none : ErrorCode::poor_fit);
  }
}

}  // namespace

void add_validate(CLI::App& app) {
  auto [command, options] = add_command<Validate>(
      app, "validate", "Error before and after on measured poses that were not used for identification");
  add_robot_option(command, options.robot);
  add_value(command, "--calibration", options.calibration, "CAL.yaml", "Calibration file")->required();
  add_value(command, "--data", options.data, "V.csv", "Measured data that were not fitted [deg, mm]")
      ->required();
  CLI::Option* report =
      add_value(command, "--report", options.report, "F.html", "Self-contained page of the result");
  command
      .add_flag(
          "--corrected", options.corrected,
          "The arm was driven with corrected commands; the joints of the data are those that the program "
          "wanted: how far is it from the drawing, in the frames of the calibration?")
      ->excludes(report);
  add_force_option(command, options.force);
  options.common.add_to(command);
  command.footer(
      "Examples:\n  flexcomp validate --robot tx60l.yaml --calibration cal.yaml --data others.csv\n"
      "  flexcomp validate --robot tx60l.yaml --calibration cal.yaml --data driven.csv --corrected\n"
      "Exit status 5: the error after is not below the error before, or chi-square per degree of freedom "
      "lies outside its 99.9 % interval.");
}

}  // namespace flexcomp::host
