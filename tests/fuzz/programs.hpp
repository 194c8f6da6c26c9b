// SPDX-License-Identifier: Apache-2.0
/// \file
/// What must hold for a program of a robot maker, whatever its language.
#pragma once

#include "exchange/arm_sides.hpp"
#include "exchange/target_program.hpp"
#include "flexcomp/forward.hpp"
#include "host_text.hpp"

namespace fuzz {

/// The pose of the tool of an arm in F0 with these joints, rad.
inline flexcomp::Pose<double> nominal_pose(const flexcomp::host::Robot& robot,
                                           const std::array<double, flexcomp::host::joint_count>& q_rad) {
  flexcomp::Model<double, flexcomp::host::joint_count, flexcomp::Capacity<1, 1, 6>> model;
  model.begin(robot.nominal);
  model.finish();
  return flexcomp::nominal_forward(model, q_rad);
}

/// Postures whose turns, quarters and sides differ; some beside the edges at which they change.
inline constexpr std::array<double, flexcomp::host::joint_count> postures[] = {
    {0, 0, 0, 0, 0.5, 0},
    {1.7, 0, 0, 0.3, -0.5, 0},
    {0, 1, -1.5, 0, 0.5, 0},
    {-1.2, 1, -1.5, 0, -0.5, 3.4},
    {0, -1.3, -1, 0, 0.5, 0},
    {2.7, -1.3, -1, 0, -0.5, 0},
    {0, -1, -1.5, 0, 0.5, 0},
    {0, -1, -1.5, 1.5, -0.5, 0},
    {0.0004, 0.3, 0.2, -0.0004, 0.5, 1.5704},
    {-0.0004, 0.3, 0.2, 1.5704, -0.6, -1.5712}};

/// Read; written with its own targets and read again; made commands of and written with them. The first byte: bit 0 commands too,
/// 1 of an IRB 120, 2 without joints to begin with, 3 in another frame, 4 with joints that are corrected. The second byte is that of
/// ticket() where there are poses: the ways to one take a hundred times as long as reading.
inline void play_program(Input input, flexcomp::host::ProgramLanguage language) {
  using namespace flexcomp::host;
  const unsigned what = input.u8();
  const unsigned given = input.u8();
  const std::string text = input.text();
  reads([&] { program_language(text.substr(text.size() - std::min<std::size_t>(text.size(), 5))); });
  TargetProgram program;
  if (!reads([&] { program = read_program(path_of(text), language); })) return;
  require(!program.targets.empty(), "a program without a target");
  const std::string written = program_text(program, program.targets);
  TargetProgram again;
  must_read(written, [&] { again = read_program(path_of(written), language); });
  require(again.targets.size() == program.targets.size() && again.warnings.size() == program.warnings.size(),
          "other targets are read from what was written");
  for (std::size_t k = 0; k < again.targets.size(); ++k) {
    const ProgramTarget& a = program.targets[k];
    const ProgramTarget& b = again.targets[k];
    require(a.line == b.line && a.name == b.name && a.pose == b.pose && a.turn == b.turn &&
                a.quadrant == b.quadrant && a.cfx == b.cfx,
            "another target is read from what was written");
    for (std::size_t j = 0; j < joint_count; ++j)
      require(std::isfinite(a.q_rad[j]) &&
                  !(std::abs(a.q_rad[j] - b.q_rad[j]) > 1e-8 * (1 + std::abs(a.q_rad[j]))),
              "joints move by writing");
    require(a.position_m.allFinite() &&
                !((a.position_m - b.position_m).norm() > 1e-8 * (1 + a.position_m.norm())),
            "a pose moves by writing");
  }
  if ((what & 1U) == 0 || program.targets.size() > 4) return;
  const auto is_pose = [](const ProgramTarget& t) { return t.pose; };
  if (given != ticket(text) && std::any_of(program.targets.begin(), program.targets.end(), is_pose)) return;
  const Robot& robot = (what & 2U) != 0 ? irb120() : tx60l();
  std::optional<std::array<double, joint_count>> start;
  if ((what & 4U) == 0) start = {0, 0, 0, 0, 0.5, 0};
  flexcomp::Pose<double> frame;
  if ((what & 8U) != 0) frame.position = {0.1, 0.2, 0.05};
  reads([&] {
    const TargetsFile commands =
        program_commands(program, robot, frame, start, [](std::size_t, std::size_t) {});
    std::vector<std::array<double, joint_count>> q;
    for (const flexcomp::host::Target& t : commands.rows) {
      q.push_back(t.q_rad);
      if ((what & 16U) == 0) continue;
      for (double& v : q.back()) v -= 1e-3;
    }
    const std::string corrected = with_commands(program, robot, frame, q);
    must_read(corrected, [&] { again = read_program(path_of(corrected), language); });
    require(again.targets.size() == program.targets.size(), "a corrected program has other targets");
  });
}

}  // namespace fuzz
