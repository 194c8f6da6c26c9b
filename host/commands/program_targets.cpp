// SPDX-License-Identifier: Apache-2.0
#include "commands/program_targets.hpp"

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>

#include "commands/common_options.hpp"
#include "commands/progress_bar.hpp"
#include "exchange/target_program.hpp"
#include "flexcomp/model.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

const std::map<std::string, ProgramLanguage> languages{
    {"kuka", ProgramLanguage::kuka}, {"rapid", ProgramLanguage::rapid}, {"val3", ProgramLanguage::val3}};

/// F0 as seen from the frame in which the program's poses are.
Pose<double> pose_of(const std::vector<double>& frame) {
  if (frame.empty()) return {};
  return small_pose<double>({frame[0] * 1e-3, frame[1] * 1e-3, frame[2] * 1e-3, radians(frame[3]),
                             radians(frame[4]), radians(frame[5])});
}

}  // namespace

bool ProgramTargets::read(const std::string& path) {
  std::optional<ProgramLanguage> language;
  if (format_.empty()) {
    language = program_language(path);
  } else if (format_ != "csv") {
    language = languages.at(format_);
  }
  if (!language && !(start_deg_.empty() && frame_.empty()))
    throw CLI::ValidationError("--start, --frame",
                               "belong to programs; a .csv has seeds of its own and poses in F0");
  if (language) program_ = std::make_shared<const TargetProgram>(read_program(path, *language));
  return language.has_value();
}

TargetsFile ProgramTargets::commands(const Robot& robot, bool quiet) const {
  std::optional<std::array<double, joint_count>> start;
  if (!start_deg_.empty()) {
    start.emplace();
    std::transform(start_deg_.begin(), start_deg_.end(), start->begin(), radians);
  }
  ProgressBar bar("solving poses", quiet);
  return program_commands(*program_, robot, pose_of(frame_), start,
                          [&bar](std::size_t done, std::size_t of) { bar.show(done, of); });
}

std::string ProgramTargets::corrected(const Robot& robot, const std::vector<Answer>& answers) const {
  std::vector<std::array<double, joint_count>> q_rad;
  std::transform(answers.begin(), answers.end(), std::back_inserter(q_rad),
                 [](const Answer& answer) { return answer.q_rad; });
  return with_commands(*program_, robot, pose_of(frame_), q_rad);
}

const std::string& ProgramTargets::name(std::size_t target) const { return program_->targets[target].name; }

void ProgramTargets::add_to(CLI::App& command) {
  command.add_option("--format", format_, "How the targets are written [default: by the file's ending]")
      ->check(CLI::IsMember({"csv", "kuka", "rapid", "val3"}));
  command
      .add_option("--start", start_deg_,
                  "Joints where a program begins [deg]: of several ways to a pose the nearest is taken")
      ->delimiter(',')
      ->expected(6)
      ->check(finite_number())
      ->type_name("Q1,…,Q6");
  command
      .add_option("--frame", frame_,
                  "Where F0 is in the frame of a program's poses: x,y,z,rx,ry,rz [mm, deg], turned by "
                  "Rot(z,rz) Rot(y,ry) Rot(x,rx)")
      ->delimiter(',')
      ->expected(6)
      ->check(finite_number())
      ->type_name("X,Y,Z,RX,RY,RZ");
}

}  // namespace flexcomp::host
