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
#include "commands/outcome.hpp"

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
  bool resume = false;
  std::string against;
  const CLI::Option* to = nullptr;

  void run() const;
  void send(OutcomeTask& task, const std::optional<Bytes>& ready) const;
  void say_active(OutcomeTask& task, const wire::Status& now, std::size_t bytes, bool sent,
                  double seconds) const;
  Bytes make(ControllerClient& client, std::vector<std::string>& left_out,
             std::optional<std::uint32_t> number) const;
  void show_changes() const;
  void check_options() const;
  void say_left_out(const std::vector<std::string>& names) const;
};

}  // namespace flexcomp::host
