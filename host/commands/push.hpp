// SPDX-License-Identifier: Apache-2.0
/// \file
/// Options of push, which the sending and the dry run share.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "bus/controller_client.hpp"
#include "commands/bus_options.hpp"

namespace flexcomp::host {

struct Push {
  BusOptions bus;
  std::string set;
  std::string robot;
  std::string image;
  std::optional<std::uint32_t> sequence;
  std::optional<double> trial_s;
  bool confirm = false;
  bool allow_unnamed = false;
  bool dry_run = false;
  std::string against;
  const CLI::Option* to = nullptr;

  void run() const;
  Bytes make(ControllerClient& client, std::vector<std::string>& left_out) const;
  void show_changes() const;
  void check_options() const;
  void say_left_out(const std::vector<std::string>& names) const;
};

}  // namespace flexcomp::host
