// SPDX-License-Identifier: Apache-2.0
#include "flexcomp/compensate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "commands/answers.hpp"
#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "commands/numbers.hpp"
#include "commands/outputs.hpp"
#include "commands/progress_bar.hpp"
#include "exchange/arm_sides.hpp"
#include "exchange/target_program.hpp"
#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "files/write_file.hpp"
#include "flexcomp/forward.hpp"
#include "flexcomp/image.hpp"
#include "flexcomp/model.hpp"
#include "input_error.hpp"
#include "kinematics/nominal_inverse.hpp"
#include "model/parameter_image.hpp"
#include "quaternion.hpp"
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
  TargetsFile from_program(const TargetProgram& program, const Robot& robot_file) const;
  std::string to_program(const TargetProgram& program, const Robot& robot_file,
                         const std::vector<Answer>& answers) const;
  Pose<double> program_frame() const;
};

const std::map<std::string, ProgramLanguage> program_languages{
    {"kuka", ProgramLanguage::kuka}, {"rapid", ProgramLanguage::rapid}, {"val3", ProgramLanguage::val3}};

/// F0 as seen from the frame in which the program's poses are.
Pose<double> Compensate::program_frame() const {
  if (frame.empty()) return {};
  return small_pose<double>({frame[0] * 1e-3, frame[1] * 1e-3, frame[2] * 1e-3, radians(frame[3]),
                             radians(frame[4]), radians(frame[5])});
}

/// The program's targets as joint commands. A pose is taken on the branch that its words name; where several remain, on
/// the one that is nearest to the command before.
TargetsFile Compensate::from_program(const TargetProgram& program, const Robot& robot_file) const {
  TargetsFile list;
  list.path = targets;
  list.warnings = program.warnings;
  std::optional<std::array<double, joint_count>> before;
  if (!start.empty()) {
    before.emplace();
    for (std::size_t j = 0; j < joint_count; ++j) (*before)[j] = radians(start[j]);
  }
  const Pose<double> f0 = program_frame();
  ProgressBar bar("solving poses", common.quiet);
  for (const ProgramTarget& t : program.targets) {
    Target target;
    target.line = t.line;
    target.context = default_context<double>(robot_file.nominal);
    target.q_rad = t.q_rad;
    if (t.pose) {
      const Eigen::Matrix3d turned = f0.rotation.transpose();
      const Pose<double> pose{turned * t.orientation.toRotationMatrix(),
                              turned * (t.position_m - f0.position)};
      std::vector<std::array<double, joint_count>> all = nominal_inverses(robot_file.nominal, pose);
      const std::size_t solutions = all.size();
      std::erase_if(all, [&t](const auto& q) { return !words_fit(t, q); });
      if (all.empty()) {
        throw InputError(
            targets, t.line, t.name,
            "a pose that the nominal arm reaches with its tool, in F0 (--frame says where F0 is)",
            solutions == 0
                ? std::string("one that it does not reach")
                : fmt::format("{} ways to reach it, none with the turns that it asks for", solutions));
      }
      // Only where several remain: there are programs whose cfx was never looked at.
      if (all.size() > 1 && t.cfx) {
        std::vector<std::array<double, joint_count>> as_said;
        std::copy_if(all.begin(), all.end(), std::back_inserter(as_said), [&](const auto& q) {
          const auto sides = arm_sides(robot_file.nominal, q);
          return sides && fits_cfx(*sides, *t.cfx);
        });
        if (!as_said.empty()) {
          all = std::move(as_said);
        } else {
          list.warnings.push_back(
              fmt::format("{}:{}: {}{}cfx {} fits none of {} ways to reach the pose: the nearest is taken.",
                          targets, t.line, t.name, t.name.empty() ? "" : ": ", *t.cfx, all.size()));
        }
      }
      if (all.size() > 1 && !before) {
        throw InputError(targets, t.line, t.name,
                         "--start q1,…,q6, the joints at the beginning, of which the nearest way is taken",
                         fmt::format("{} ways to reach the pose", all.size()));
      }
      const auto away = [&before](const auto& q) {
        double most = 0;
        for (std::size_t j = 0; before && j < joint_count; ++j)
          most = std::max(most, std::abs(q[j] - (*before)[j]));
        return most;
      };
      target.q_rad = *std::min_element(all.begin(), all.end(),
                                       [&](const auto& a, const auto& b) { return away(a) < away(b); });
    }
    before = target.q_rad;
    list.rows.push_back(std::move(target));
    bar.show(list.rows.size(), program.targets.size());
  }
  return list;
}

/// A corrected pose is the one that brings the robot's own nominal kinematics to the corrected joints.
std::string Compensate::to_program(const TargetProgram& program, const Robot& robot_file,
                                   const std::vector<Answer>& answers) const {
  Model<double, joint_count, Capacity<1, 1, 6>> nominal;
  nominal.begin(robot_file.nominal);
  nominal.finish();
  const Pose<double> f0 = program_frame();
  std::vector<ProgramTarget> corrected = program.targets;
  for (std::size_t k = 0; k < corrected.size(); ++k) {
    ProgramTarget& t = corrected[k];
    t.q_rad = answers[k].q_rad;
    if (!t.pose) continue;
    const Pose<double> pose = f0 * nominal_forward(nominal, t.q_rad);
    t.position_m = pose.position;
    t.orientation = unit_quaternion(pose.rotation);
    if (t.turn) t.turn = turn_of(t.q_rad, *t.turn);
    if (t.quadrant) t.quadrant = quadrants_of(t.q_rad, *t.quadrant);
  }
  return program_text(program, corrected);
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
  const TargetsFile list =
      program ? from_program(*program, robot_file) : load_targets(targets, robot_file, {force});
  common.warn(list.warnings);

  // Through the image and a model of the controller's size: what is answered here is what the controller answers.
  const std::vector<std::uint8_t> image =
      make_image(set, robot_file, set.sequence.value_or(0), {.allow_unnamed = allow_unnamed});
  const auto model = std::make_unique<Model<double, joint_count>>();
  const Refusal refusal = model_from_image(image.data(), image.size(), robot_file.nominal, *model);
  if (refusal != Refusal::none)
    throw InputError(calibration, 0, "", "a set that a controller can hold", text(refusal));

  const auto commands = joint_commands(list, robot_file);
  std::vector<Answer> answers;
  for (std::size_t k = 0; k < commands.size(); ++k) {
    const auto& context = list.rows[k].context;
    const auto result = compensate(*model, commands[k], context, CompensationSettings<double>{});
    // Of a command that is passed through the controller says nothing, and 0 on the wire.
    TargetResidual<double> residual;
    if (result.status != StepStatus::refused) {
      residual = target_residual(*model, result.q, commands[k], context);
    }
    answers.push_back({result.q, residual.position_m, residual.orientation_rad, result.status});
  }
  write_file(out, program ? to_program(*program, robot_file, answers) : answers_text(list, answers));
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
