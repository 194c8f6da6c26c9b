/// \file
/// Options that the commands which talk to a controller have in common.
#ifndef FLEXCOMP_HOST_COMMANDS_BUS_OPTIONS_HPP
#define FLEXCOMP_HOST_COMMANDS_BUS_OPTIONS_HPP

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "bus/controller_client.hpp"

namespace flexcomp::host {

struct BusOptions {
  BusAddress bus;
  double timeout_s = 3;
  std::string json;
  bool quiet = false;

  /// `name` is --to, --from, --of or --at.
  void add_to(CLI::App& app, const std::string& name);
  std::unique_ptr<ControllerClient> connect() const;

  /// Text for people, unless quiet.
  void say(const std::string& text) const;
  /// The result as a file, where one is asked for.
  void write_json(const nlohmann::ordered_json& result) const;
};

}  // namespace flexcomp::host

#endif
