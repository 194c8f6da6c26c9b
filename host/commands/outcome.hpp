// SPDX-License-Identifier: Apache-2.0
/// \file
/// The word in which a command that changes the active set of a controller ends: active, refused or open.
#pragma once

#include <functional>
#include <memory>

#include "bus/controller_client.hpp"
#include "commands/bus_options.hpp"
#include "json.hpp"

namespace flexcomp::host {

/// A command's work on a controller. It connects by itself, so that who cannot be reached is told in one of the words as well.
struct OutcomeTask {
  OutcomeTask(const BusOptions& bus, bool is_undecided);
  OutcomeTask(const OutcomeTask&) = delete;
  OutcomeTask& operator=(const OutcomeTask&) = delete;

  std::unique_ptr<ControllerClient> client;  ///< once there is one
  Json result;  ///< "outcome" and "why" are added, and written also for refused and open
  /// Whether a set of an earlier call may still become active. Who cannot be asked is then open, not refused.
  bool undecided = false;
};

/// Runs `work`, which fills task.result and says what is active. \throws BusError, OutcomeOpen with the word before the message
void run_to_outcome(const BusOptions& bus, const std::function<void(OutcomeTask&)>& work,
                    bool undecided = false);

}  // namespace flexcomp::host
