#include "commands/bus_options.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "files/write_file.hpp"

namespace flexcomp::host {

void BusOptions::add_to(CLI::App& app, const std::string& name) {
  app.add_option_function<std::string>(
         name,
         [this, name](const std::string& text) {
           try {
             bus = parse_bus_address(text);
           } catch (const std::invalid_argument& e) {
             throw CLI::ValidationError(name, e.what());
           }
         },
         "controller: can:IFACE[:NODE], modbus-tcp:HOST[:PORT][:UNIT] or "
         "modbus-rtu:DEVICE[:BAUD[:PARITY]][:UNIT]\n"
         "(defaults: node 1; port 502, unit 255; 19200 baud, parity E, unit 1)")
      ->required()
      ->type_name("BUS");
  app.add_option("--timeout", timeout_s, "how long the controller may keep silent, s")
      ->check(CLI::Range(0.05, 3600.0))
      ->capture_default_str();
  app.add_option("--json", json, "write the result to this file, for programs")->type_name("FILE");
  app.add_flag("--quiet", quiet, "say nothing but errors");
}

std::unique_ptr<ControllerClient> BusOptions::connect() const {
  ClientOptions options;
  options.patience = std::chrono::milliseconds(static_cast<long>(timeout_s * 1000));
  return host::connect(bus, options);
}

void BusOptions::say(const std::string& text) const {
  if (!quiet) fmt::print("{}\n", text);
}

void BusOptions::write_json(const nlohmann::ordered_json& result) const {
  if (!json.empty()) write_file(json, result.dump(2) + "\n");
}

}  // namespace flexcomp::host
