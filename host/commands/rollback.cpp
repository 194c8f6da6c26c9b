// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <memory>

#include "bus/transfer.hpp"
#include "commands/bus_options.hpp"
#include "commands/commands.hpp"
#include "commands/outcome.hpp"

namespace flexcomp::host {
namespace {

void return_to_previous(const BusOptions& bus) {
  run_to_outcome(bus, [&bus](OutcomeTask& task) {
    task.client = bus.connect();
    ControllerClient& client = *task.client;
    const std::uint32_t before = client.status().active_sequence;
    task.result["dropped"] = before;
    const std::uint32_t after = roll_back(client).active_sequence;
    task.result["sequence"] = after;
    bus.say(after == 0 ? fmt::format("{}: set {} is dropped, no set is active", client.where(), before)
                       : fmt::format("{}: set {} is active again, set {} is dropped", client.where(), after,
                                     before));
  });
}

}  // namespace

void add_rollback(CLI::App& app) {
  auto state = std::make_shared<BusOptions>();
  CLI::App* command = app.add_subcommand("rollback", "Return a controller to the set that it had before");
  state->add_bus_to(*command, "--at");
  command->footer(
      "Ends in one of three words (JSON \"outcome\"): active, the set before runs again, exit status 0; "
      "refused, nothing "
      "has changed, 4; open, it cannot be told now, 5: \"flexcomp status\" tells which set runs.\n"
      "Example:\n  flexcomp rollback --at can:vcan0:5");
  command->callback([state] { return_to_previous(*state); });
}

}  // namespace flexcomp::host
