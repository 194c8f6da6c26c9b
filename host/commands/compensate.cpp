// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "commands/answers.hpp"
#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "commands/numbers.hpp"
#include "commands/outputs.hpp"
#include "commands/progress_bar.hpp"
#include "exchange/program_targets.hpp"
#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "files/write_file.hpp"
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
  std::string format;
  std::vector<double> start;
  std::vector<double> frame;  // x y z mm, rx ry rz deg
  bool allow_unnamed = false;
  bool force = false;

  void run() const;

 private:
  Pose<double> program_frame() const;
  std::optional<std::array<double, joint_count>> start_joints() const;
};

const std::map<std::string, ProgramLanguage> program_languages{
    {"kuka", ProgramLanguage::kuka}, {"rapid", ProgramLanguage::rapid}, {"val3", ProgramLanguage::val3}};

/// F0 as seen from the frame in which the program's poses are.
Pose<double> Compensate::program_frame() const {
  if (frame.empty()) return {};
  return small_pose<double>({frame[0] * 1e-3, frame[1] * 1e-3, frame[2] * 1e-3, radians(frame[3]),
                             radians(frame[4]), radians(frame[5])});
}

std::optional<std::array<double, joint_count>> Compensate::start_joints() const {
  if (start.empty()) return {};
  std::array<double, joint_count> q{};
  for (std::size_t j = 0; j < joint_count; ++j) q[j] = radians(start[j]);
  return q;
}

void Compensate::run() const {
  refuse_same_file({{"--robot", robot}, {"--calibration", calibration}, {"--targets", targets}},
                   {{"-o", out}, {"--json", common.json}});
  const Robot robot_file = load_robot(robot);
  const Calibration set = load_calibration(calibration, robot_file);
  std::optional<ProgramLanguage> language = program_language(targets);
  if (!format.empty()) {
    language.reset();
    if (format != "csv") language = program_languages.at(format);
  }
  if (!language && !(start.empty() && frame.empty()))
    throw CLI::ValidationError("--start, --frame",
                               "belong to programs; a .csv has seeds of its own and poses in F0");
  std::optional<TargetProgram> program;
  if (language) program = read_program(targets, *language);
  TargetsFile list;
  if (program) {
    ProgramTargets how{program_frame(), start_joints(), {}};
    ProgressBar bar("solving poses", common.quiet);
    how.progress = bar.callback();
    list = joint_targets(*program, robot_file, how);
  } else {
    list = load_targets(targets, robot_file, {force});
  }
  common.warn(list.warnings);

  const auto commands = joint_commands(list, robot_file);
  const std::vector<Answer> answers =
      compensated(list, commands, set, robot_file, {.allow_unnamed = allow_unnamed});
  write_file(out, program ? corrected_text(*program, robot_file, program_frame(), answers)
                          : answers_text(list, answers));
  // A program has no column for what the controller would say.
  for (std::size_t k = 0; program && k < answers.size(); ++k) {
    if (answers[k].status == StepStatus::ok) continue;
    const std::string& target = program->targets[k].name;
    common.warn({fmt::format("{}:{}: {}{} is {}.", targets, list.rows[k].line, target,
                             target.empty() ? "the target" : "", name(answers[k].status))});
  }
  const nlohmann::ordered_json summary = answers_summary(commands, answers);
  common.say(fmt::format(
      "{}: {} corrected commands, {} of them ok; largest correction {:.4f} deg, largest residual {:.2g} mm",
      out, answers.size(), summary["status"]["ok"].get<int>(),
      summary["largest_correction_deg"].get<double>(), summary["residual_max_mm"].get<double>()));
  common.write_json(summary);
}

}  // namespace

void add_compensate(CLI::App& app) {
  auto options = std::make_shared<Compensate>();
  CLI::App* command = app.add_subcommand(
      "compensate", "Corrected joint commands for targets, as the controller would give them");
  add_robot_option(*command, options->robot);
  command->add_option("--calibration", options->calibration, "Calibration file")
      ->type_name("CAL.yaml")
      ->required();
  command
      ->add_option(
          "--targets", options->targets,
          "Targets: q1_deg … q6_deg [deg], or a pose of Ftool in F0 (x_mm y_mm z_mm qw qx qy qz) with "
          "seed1_deg … seed6_deg; context columns as in data files. Or a program: KUKA .src .dat, ABB .mod, "
          "Stäubli .dtx")
      ->type_name("FILE")
      ->required();
  command
      ->add_option(
          "-o,--output", options->out,
          "q1_deg … q6_deg (corrected), residual_mm, residual_deg (what the model still misses), status (ok "
          "near_singular limited at_limit no_set refused); of a program, the program with its targets "
          "corrected")
      ->type_name("FILE")
      ->required();
  command
      ->add_option("--format", options->format, "How the targets are written [default: by the file's ending]")
      ->check(CLI::IsMember({"csv", "kuka", "rapid", "val3"}));
  command
      ->add_option("--start", options->start,
                   "Joints where a program begins [deg]: of several ways to a pose the nearest is taken")
      ->delimiter(',')
      ->expected(6)
      ->check(finite_number())
      ->type_name("Q1,…,Q6");
  command
      ->add_option("--frame", options->frame,
                   "Where F0 is in the frame of a program's poses: x,y,z,rx,ry,rz [mm, deg], turned by "
                   "Rot(z,rz) Rot(y,ry) Rot(x,rx)")
      ->delimiter(',')
      ->expected(6)
      ->check(finite_number())
      ->type_name("X,Y,Z,RX,RY,RZ");
  command->add_flag("--allow-unnamed", options->allow_unnamed, "Also use what was found but not understood");
  add_force_option(*command, options->force);
  options->common.add_to(*command);
  command->footer(
      "Examples:\n"
      "  flexcomp compensate --robot tx60l.yaml --calibration cal.yaml --targets t.csv -o corrected.csv\n"
      "  flexcomp compensate --robot kr6.yaml --calibration kr6_cal.yaml --targets weld.src --start "
      "0,-90,90,0,0,0 -o corrected.src\n"
      "A program's poses are of the robot file's tool, in the frame of --frame [default: F0]. Its bytes "
      "stay, but for the "
      "targets' numbers.");
  command->callback([options] { options->run(); });
}

}  // namespace flexcomp::host
