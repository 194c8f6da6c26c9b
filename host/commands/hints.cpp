// SPDX-License-Identifier: Apache-2.0
#include "commands/hints.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string_view>

#include "bus/controller_client.hpp"
#include "errors.hpp"
#include "nearest.hpp"

namespace flexcomp::host {

namespace {

/// The file beside the one that is not there, whose name is nearest: a slip in the name or in its ending, not in both, for
/// endings are alike anyway.
std::string nearest_file(const std::string& path) {
  namespace fs = std::filesystem;
  const fs::path wanted(path);
  const fs::path folder = wanted.has_parent_path() ? wanted.parent_path() : fs::path(".");
  std::error_code error;
  std::vector<std::string> stems;    // of files with the same ending
  std::vector<std::string> endings;  // of files with the same stem
  std::size_t seen = 0;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    if (++seen > 10000) return {};
    if (!at->is_regular_file(error)) continue;
    const fs::path& file = at->path();
    if (file.extension() == wanted.extension()) stems.push_back(file.stem().string());
    if (file.stem() == wanted.stem()) endings.push_back(file.extension().string());
  }
  std::sort(stems.begin(), stems.end());
  std::sort(endings.begin(), endings.end());
  std::string near = nearest(wanted.stem().string(), stems);
  if (!near.empty()) {
    near += wanted.extension().string();
  } else if (const std::string ending = nearest(wanted.extension().string(), endings); !ending.empty()) {
    near = wanted.stem().string() + ending;
  }
  return near.empty() ? "" : (wanted.has_parent_path() ? (wanted.parent_path() / near).string() : near);
}

std::string of_input(const InputError& e, const std::string& command) {
  const auto expects = [&e](std::string_view text) { return e.expected().find(text) != std::string::npos; };
  if (expects("a file that can be read") && e.found() == "none") {
    const std::string near = nearest_file(e.file());
    return near.empty() ? "" : fmt::format("there is {}", near);
  }
  if (expects("this column (") && command != "import" && !e.file().ends_with(".yaml")) {
    return "\"flexcomp import --joints LOG.csv\" makes a data file of an instrument's export and a robot's "
           "log";
  }
  if (command == "import" && e.expected().starts_with("XML") && !e.file().ends_with(".urdf") &&
      !e.file().ends_with(".xml"))
    return "an instrument's points become data with --joints LOG.csv --robot ROBOT.yaml";
  if (expects("points that are also in"))
    return "--names takes the points' names apart, as --names '*::{pose}_{reflector}'; --join order asks for "
           "none";
  if (expects("look like radians") || e.found().find("look like radians") != std::string::npos)
    return "\"flexcomp import --joint-unit rad\" reads a log in radians";
  return {};
}

std::string of_bus(const std::string& message, bool silent) {
  const std::string_view text = message;
  const std::string where(text.substr(0, text.find(": ")));
  if (!silent) {
    const bool bus = text.starts_with("can:") || text.starts_with("modbus-");
    return bus ? fmt::format("\"flexcomp status --of {}\" says what this controller is, holds and does",
                             where)
               : "";
  }
  if (text.starts_with("can:")) {
    if (text.find("no CAN sockets") != std::string_view::npos)
      return "\"modprobe can_raw\" loads the kernel's CAN, where it has one; \"hil/with-vcan COMMAND\" gives "
             "any machine a bus to try";
    const std::string interface = where.substr(4, where.find(':', 4) - 4);
    return fmt::format(
        "\"ip -details link show {}\" says whether the interface is up and at which bit rate; then check the "
        "node's number, wiring and power",
        interface);
  }
  if (text.starts_with("modbus-rtu:"))
    return "check device, baud rate, parity and unit (modbus-rtu:DEVICE:BAUD:PARITY:UNIT); --timeout waits "
           "longer";
  if (text.starts_with("modbus-tcp:"))
    return "check that the controller is on and reachable, its port and unit (modbus-tcp:HOST:PORT:UNIT); "
           "--timeout waits longer";
  return {};
}

}  // namespace

std::string hint(const std::exception& error, const std::string& command) {
  if (const auto* input = dynamic_cast<const InputError*>(&error)) return of_input(*input, command);
  if (dynamic_cast<const BusError*>(&error) != nullptr) {
    const std::string message = error.what();
    const bool refused = dynamic_cast<const RefusedByController*>(&error) != nullptr;
    // Who cannot be reached cannot be asked for its status either.
    const bool silent = !refused && (dynamic_cast<const NoAnswer*>(&error) != nullptr ||
                                     message.find("cannot be opened") != std::string::npos ||
                                     message.find("connect") != std::string::npos ||
                                     message.find("CAN sockets") != std::string::npos ||
                                     message.find("interface") != std::string::npos);
    return of_bus(message, silent);
  }
  if (dynamic_cast<const DoubtfulResult*>(&error) != nullptr &&
      std::string_view(error.what()).find("chi-square") != std::string_view::npos) {
    return "\"flexcomp diagnose\" with the same robot and data looks for the effect that the model lacks";
  }
  return {};
}

std::string usage_hint(const CLI::App& app, const std::vector<std::string>& arguments) {
  std::vector<std::string> commands;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    commands.push_back(command->get_name());
  if (arguments.empty()) return "\"flexcomp --help\" lists the commands";
  const std::string& first = arguments.front();
  if (std::find(commands.begin(), commands.end(), first) == commands.end()) {
    const std::string near = first.starts_with('-') ? "" : nearest(first, commands);
    return near.empty() ? "\"flexcomp --help\" lists the commands"
                        : fmt::format("did you mean \"flexcomp {}\"?", near);
  }
  const CLI::App* const command = app.get_subcommand(first);
  std::vector<std::string> options;
  for (const CLI::Option* option : command->get_options()) {
    for (const std::string& name : option->get_lnames()) options.push_back("--" + name);
  }
  for (const std::string& argument : arguments) {
    if (!argument.starts_with("--")) continue;
    const std::string name = argument.substr(0, argument.find('='));
    if (std::find(options.begin(), options.end(), name) != options.end()) continue;
    const std::string near = nearest(name, options);
    if (!near.empty()) return fmt::format("did you mean {}?", near);
  }
  return fmt::format("\"flexcomp {} --help\" has its options and an example", first);
}

}  // namespace flexcomp::host
