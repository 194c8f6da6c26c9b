// SPDX-License-Identifier: Apache-2.0
#include "commands/bus_options.hpp"

#include <stdexcept>

#include "commands/common_options.hpp"

namespace flexcomp::host {

void BusOptions::add_bus_to(CLI::App& app, const std::string& name) {
  app.add_option_function<std::string>(
         name,
         [this, name](const std::string& text) {
           try {
             bus = parse_bus_address(text);
           } catch (const std::invalid_argument& e) {
             throw CLI::ValidationError(name, e.what());
           }
         },
         "Controller: can:IFACE[:NODE[:CHANNEL]], modbus-tcp:HOST[:PORT][:UNIT] or "
         "modbus-rtu:DEVICE[:BAUD[:PARITY]][:UNIT]; "
         "by default node 1, CHANNEL own or 684-6B4 for SDO server 1201h; port 502, unit 255; 19200 baud, "
         "parity E, unit 1")
      ->required()
      ->type_name("BUS");
  app.add_option("--timeout", timeout_s, "How long the controller may keep silent [s]")
      ->check(number_between(0.05, 3600.0))
      ->capture_default_str();
  add_to(app);
}

std::unique_ptr<ControllerClient> BusOptions::connect() const {
  ClientOptions options;
  options.response_timeout = std::chrono::milliseconds(static_cast<long>(timeout_s * 1000));
  return host::connect(bus, options);
}

void add_optional_robot_option(CLI::App& app, std::string& path) {
  app.add_option("--robot", path, "Robot file; by default the controller tells which arm it is for")
      ->type_name("ROBOT.yaml");
}

}  // namespace flexcomp::host
