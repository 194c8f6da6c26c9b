// SPDX-License-Identifier: Apache-2.0
/// \file
/// What must hold for a program of a robot maker, whatever its language.
#pragma once

#include "exchange/target_program.hpp"
#include "host_text.hpp"

namespace fuzz {

/// Read; written with its own targets and read again; made commands of and written with them. The first byte: bit 0 commands too.
inline void play_program(Input input, flexcomp::host::ProgramLanguage language) {
  using namespace flexcomp::host;
  const unsigned what = input.u8();
  const std::string text = input.text();
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
  std::array<double, joint_count> start{};
  start[4] = 0.5;
  reads([&] {
    const TargetsFile commands =
        program_commands(program, tx60l(), flexcomp::Pose<double>(), start, [](std::size_t, std::size_t) {});
    std::vector<std::array<double, joint_count>> q;
    for (const flexcomp::host::Target& t : commands.rows) q.push_back(t.q_rad);
    with_commands(program, tx60l(), flexcomp::Pose<double>(), q);
  });
}

}  // namespace fuzz
