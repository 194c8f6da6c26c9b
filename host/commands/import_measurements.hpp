// SPDX-License-Identifier: Apache-2.0
/// \file
/// The half of `import` that makes a data file of an instrument's export and a robot's log.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "commands/common_options.hpp"

namespace flexcomp::host {

struct ImportMeasurements {
  std::string robot;
  std::string joints;
  std::string map;
  std::vector<std::string> joint_columns;
  std::string joint_unit;
  std::string unit;
  std::string angle_unit;
  std::string angles;
  std::vector<std::string> columns;
  std::string delimiter;
  std::string decimal;
  double coverage = 1;
  std::string by;
  std::string names;
  std::size_t reflectors = 0;
  bool repeats = false;
  double tolerance_s = 0.5;
  double shift_s = 0;
  bool force = false;

  const CLI::App* command = nullptr;

  void add_to(CLI::App& command);
  bool asked() const { return !joints.empty(); }
  /// \throws CLI::ValidationError  an option of this half without --joints
  void refuse_without_joints() const;
  void run(const CommonOptions& common, const std::string& source, const std::string& out) const;

 private:
  /// \throws CLI::ValidationError  an option that belongs to another --join
  void refuse_idle() const;
};

}  // namespace flexcomp::host
