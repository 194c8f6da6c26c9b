// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <memory>

#include "commands/bus_options.hpp"
#include "commands/commands.hpp"
#include "json.hpp"

namespace flexcomp::host {
namespace {

void roll_back(const BusOptions& bus) {
  const std::unique_ptr<ControllerClient> client = bus.connect();
  const std::uint32_t before = client->status().active_sequence;
  client->run(wire::Command::rollback);
  const std::uint32_t after = client->status().active_sequence;
  bus.say(after == 0
              ? fmt::format("{}: set {} is dropped, no set is active", client->where(), before)
              : fmt::format("{}: set {} is active again, set {} is dropped", client->where(), after, before));
  bus.write_json({{"bus", client->where()}, {"dropped", before}, {"sequence", after}});
}

}  // namespace

void add_rollback(CLI::App& app) {
  auto state = std::make_shared<BusOptions>();
  CLI::App* command = app.add_subcommand("rollback", "Return a controller to the set that it had before");
  state->add_bus_to(*command, "--at");
  command->footer("Example:\n  flexcomp rollback --at can:vcan0:5");
  command->callback([state] { roll_back(*state); });
}

}  // namespace flexcomp::host
