// SPDX-License-Identifier: Apache-2.0
/// \file
/// Programs of robot makers as targets of `compensate`. without_exchange.cpp takes the place of program_targets.cpp in a build
/// without foreign formats.
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "commands/answers.hpp"
#include "model/robot.hpp"
#include "model/targets.hpp"

namespace flexcomp::host {

struct TargetProgram;

class ProgramTargets {
 public:
  /// --format, --start and --frame.
  void add_to(CLI::App& command);

  /// Whether these targets are a program; then it is read. \throws InputError  as read_program()
  bool read(const std::string& path);

  /// \throws InputError  as program_commands()
  TargetsFile commands(const Robot& robot, bool quiet) const;
  std::string corrected(const Robot& robot, const std::vector<Answer>& answers) const;
  const std::string& name(std::size_t target) const;

 private:
  std::string format_;
  std::vector<double> start_deg_;
  std::vector<double> frame_;  // x y z mm, rx ry rz deg
  std::shared_ptr<const TargetProgram> program_;
};

}  // namespace flexcomp::host
