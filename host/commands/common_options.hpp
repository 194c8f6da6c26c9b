// SPDX-License-Identifier: Apache-2.0
/// \file
/// Options that every command has, and the two ways in which a command speaks: text for people, JSON for machines.
#ifndef FLEXCOMP_HOST_COMMANDS_COMMON_OPTIONS_HPP
#define FLEXCOMP_HOST_COMMANDS_COMMON_OPTIONS_HPP

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "json.hpp"
#include "measurement/measured_data.hpp"
#include "model/paper_model.hpp"
#include "named_values.hpp"
#include "report/page.hpp"

namespace flexcomp::host {

struct CommonOptions {
  std::string json;
  bool quiet = false;
  std::uint64_t seed = 1;

  void add_to(CLI::App& app);       ///< --json, --quiet
  void add_seed_to(CLI::App& app);  ///< --seed, wherever randomness is used

  /// A line for people on standard output, unless quiet.
  void say(const std::string& text) const;
  /// Warnings go to standard error, also when quiet: they say that something may be wrong.
  void warn(const std::vector<std::string>& warnings) const;
  /// The result as a file, where one is asked for.
  void write_json(const Json& result) const;
  /// The page that `make` gives as a file, where one is asked for, with a line that says so.
  void write_report(const std::string& path, const std::function<Page()>& make) const;
};

/// --robot, required.
void add_robot_option(CLI::App& app, std::string& path);
/// --force: go on where input is only suspicious.
CLI::Option* add_force_option(CLI::App& app, bool& force);

}  // namespace flexcomp::host

#endif
