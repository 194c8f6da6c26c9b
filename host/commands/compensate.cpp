// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <string>
#include <vector>

#include "commands/answers.hpp"
#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "commands/program_targets.hpp"
#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "files/write_file.hpp"
#include "json.hpp"
#include "kinematics/compensated_targets.hpp"
#include "kinematics/nominal_inverse.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

struct Compensate {
  CommonOptions common;
  std::string robot;
  std::string calibration;
  std::string targets;
  std::string out;
  ProgramTargets programs;
  bool allow_unnamed = false;
  bool force = false;

  void run();
};

void Compensate::run() {
  refuse_same_file({{"--robot", robot}, {"--calibration", calibration}, {"--targets", targets}},
                   {{"-o", out}, {"--json", common.json}});
  const Robot robot_file = load_robot(robot);
  const Calibration set = load_calibration(calibration, robot_file);
  const bool of_program = programs.read(targets);
  const TargetsFile list =
      of_program ? programs.commands(robot_file, common.quiet) : load_targets(targets, robot_file, {force});
  common.warn(list.warnings);

  const auto commands = joint_commands(list, robot_file);
  const std::vector<Answer> answers =
      compensated(list, commands, set, robot_file, {.allow_unnamed = allow_unnamed});
  write_file(out, of_program ? programs.corrected(robot_file, answers) : answers_text(list, answers));
  // A program has no column for what the controller would say.
  for (std::size_t k = 0; of_program && k < answers.size(); ++k) {
    if (answers[k].status == StepStatus::ok) continue;
    const std::string& target = programs.name(k);
    common.warn({fmt::format("{}:{}: {}{} is {}.", targets, list.rows[k].line, target,
                             target.empty() ? "the target" : "", status_words(answers[k].flags))});
  }
  const Json summary = answers_summary(commands, answers);
  common.say(fmt::format(
      "{}: {} corrected commands, {} of them ok; largest correction {:.4f} deg, largest residual {:.2g} mm",
      out, answers.size(), summary["status"]["ok"].get<int>(),
      summary["largest_correction_deg"].get<double>(), summary["residual_max_mm"].get<double>()));
  common.write_json(summary);
}

}  // namespace

void add_compensate(CLI::App& app) {
  auto [command, options] = add_command<Compensate>(
      app, "compensate", "Corrected joint commands for targets, as the controller would give them");
  add_robot_option(command, options.robot);
  add_value(command, "--calibration", options.calibration, "CAL.yaml", "Calibration file")->required();
  add_value(
      command, "--targets", options.targets, "FILE",
      "Targets: q1_deg … q6_deg [deg], or a pose of Ftool in F0 (x_mm y_mm z_mm qw qx qy qz) with "
      "seed1_deg … seed6_deg; context columns as in data files. Or a program: KUKA .src .dat, ABB .mod, "
      "Stäubli .dtx")
      ->required();
  add_value(
      command, "-o,--output", options.out, "FILE",
      "q1_deg … q6_deg (corrected), residual_mm, residual_deg (what the model still misses), status "
      "(ok, or all that hold of near_singular limited at_limit not_converged no_set refused, joined by +); "
      "of a program, the program with its targets corrected")
      ->required();
  options.programs.add_to(command);
  command.add_flag("--allow-unnamed", options.allow_unnamed, "Also use what was found but not understood");
  add_force_option(command, options.force);
  options.common.add_to(command);
  command.footer(
      "Examples:\n"
      "  flexcomp compensate --robot tx60l.yaml --calibration cal.yaml --targets t.csv -o corrected.csv\n"
      "  flexcomp compensate --robot kr6.yaml --calibration kr6_cal.yaml --targets weld.src --start "
      "0,-90,90,0,0,0 -o corrected.src\n"
      "A program's poses are of the robot file's tool, in the frame of --frame [default: F0]. Its bytes "
      "stay, but for the "
      "targets' numbers.");
}

}  // namespace flexcomp::host
