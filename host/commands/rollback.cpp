// SPDX-License-Identifier: Apache-2.0
// The two commands that destroy sets: rollback drops the active one, erase both.
#include <fmt/format.h>
#include <unistd.h>

#include <functional>
#include <iostream>
#include <string>

#include "bus/transfer.hpp"
#include "commands/bus_options.hpp"
#include "commands/commands.hpp"
#include "commands/key_options.hpp"
#include "commands/outcome.hpp"

namespace flexcomp::host {
namespace {

/// What both have in common.
struct Destroy {
  BusOptions bus;
  std::string robot;
  KeyOptions signing;

  void add_to(CLI::App& app) {
    bus.add_bus_to(app, "--at");
    app.add_option("--robot", robot,
                   "Robot file: refused where the controller is not this arm, or not this unit")
        ->type_name("ROBOT.yaml");
    signing.add_to(app, "Sign the command with this private key, where the controller trusts keys");
  }

  using Work = std::function<wire::Status(ControllerClient&)>;

  /// Connects, asks, authorises and does it. \param ask  before anything is sent
  wire::Status run(OutcomeTask& task, wire::Command command, const SigningKey* signer, const Work& work,
                   const std::function<void(ControllerClient&)>& ask = {}) const {
    task.client = bus.connect();
    ControllerClient& client = *task.client;
    if (!robot.empty()) robot_of(client, robot);
    if (ask) ask(client);
    task.result["dropped"] = client.status().active_sequence;
    try {
      signing.authorise(task, command, signer);
      return work(client);
    } catch (const RefusedByController& e) {
      if (e.answer() != wire::Answer::not_authorised || signer != nullptr) throw;
      const std::optional<ControllerUnit> unit = client.unit();
      if (!unit || unit->keys == 0) throw;
      throw RefusedByController(
          e.address(),
          fmt::format("{}: it trusts {}, and --key signs the command", e.text(), keys_text(*unit)),
          e.answer(), e.refusal());
    }
  }
};

struct Rollback : Destroy {
  void run() const {
    const std::optional<SigningKey> signer = signing.signer();
    run_to_outcome(bus, [&](OutcomeTask& task) {
      const std::uint32_t after =
          Destroy::run(task, wire::Command::rollback, signer ? &*signer : nullptr, roll_back).active_sequence;
      const auto before = task.result["dropped"].get<std::uint32_t>();
      task.result["sequence"] = after;
      const std::string& where = task.client->where();
      bus.say(after == 0
                  ? fmt::format("{}: set {} is dropped, no set is active", where, before)
                  : fmt::format("{}: set {} is active again, set {} is dropped", where, after, before));
    });
  }
};

struct Erase : Destroy {
  bool yes = false;

  void run() const {
    if (!yes && ::isatty(STDIN_FILENO) == 0)
      throw CLI::ValidationError("--yes", "required where nobody can be asked");
    const std::optional<SigningKey> signer = signing.signer();
    run_to_outcome(bus, [&](OutcomeTask& task) {
      Destroy::run(task, wire::Command::restore_defaults, signer ? &*signer : nullptr, erase,
                   [this](ControllerClient& client) {
                     if (!yes) ask(client);
                   });
      task.result["sequence"] = 0;
      bus.say(fmt::format("{}: both sets are erased, commands pass through", task.client->where()));
    });
  }

  static void ask(ControllerClient& client) {
    const std::optional<Robot> told = client.robot();
    const std::string name = told && !told->name.empty() ? told->name : "erase";
    fmt::print("{}: both sets of {}{} will be erased. Its name, to go on: ", client.where(), name,
               told && !told->serial.empty() ? fmt::format(" (unit '{}')", told->serial) : "");
    std::fflush(stdout);
    std::string answer;
    std::getline(std::cin, answer);
    if (answer != name)
      throw CLI::ValidationError("--yes", fmt::format("'{}' was to be typed; nothing was sent", name));
  }
};

}  // namespace

void add_rollback(CLI::App& app) {
  auto [command, state] =
      add_command<Rollback>(app, "rollback", "Return a controller to the set that it had before");
  state.add_to(command);
  command.footer(
      "Ends in one of three words (JSON \"outcome\"): active, the set before runs again, exit status 0; "
      "refused, nothing "
      "has changed, 4; open, it cannot be told now, 5: \"flexcomp status\" tells which set runs.\n"
      "Out of a trial nobody is asked; else a controller that trusts keys asks for --key.\n"
      "Example:\n  flexcomp rollback --at can:vcan0:5");
}

void add_erase(CLI::App& app) {
  auto [command, state] =
      add_command<Erase>(app, "erase", "Erase both sets of a controller: commands pass through from then on");
  state.add_to(command);
  command.add_flag("--yes", state.yes, "Do not ask for the robot's name");
  command.footer(
      "Ends in one of three words (JSON \"outcome\"): active, no set is there any more, exit status 0; "
      "refused, "
      "nothing has changed, 4; open, it cannot be told now, 5: \"flexcomp status\" tells which set runs.\n"
      "A controller that trusts keys asks for --key.\n"
      "Example:\n  flexcomp erase --at can:vcan0:5 --yes");
}

}  // namespace flexcomp::host
