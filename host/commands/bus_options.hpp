// SPDX-License-Identifier: Apache-2.0
/// \file
/// Options that the commands which talk to a controller have in common.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "bus/controller_client.hpp"
#include "commands/common_options.hpp"

namespace flexcomp::host {

struct BusOptions : CommonOptions {
  BusAddress bus;
  double timeout_s = 3;

  /// `name` is --to, --from, --of or --at; with --timeout, --json and --quiet.
  void add_bus_to(CLI::App& app, const std::string& name);
  std::unique_ptr<ControllerClient> connect() const;
};

/// --robot, for where the controller does not tell which arm it is for.
void add_optional_robot_option(CLI::App& app, std::string& path);

}  // namespace flexcomp::host
