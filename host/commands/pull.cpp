// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <memory>
#include <string>

#include "bus/transfer.hpp"
#include "commands/bus_options.hpp"
#include "commands/commands.hpp"
#include "commands/progress_bar.hpp"
#include "files/calibration_file.hpp"
#include "files/write_file.hpp"
#include "json.hpp"
#include "model/parameter_image.hpp"

namespace flexcomp::host {
namespace {

struct Pull {
  BusOptions bus;
  std::string out;
  std::string robot;
  std::string image;

  void run() const {
    if (out.empty() && image.empty())
      throw CLI::ValidationError("-o", "give a file to write, by -o or by --image");
    refuse_same_file({{"--robot", robot}}, {{"-o", out}, {"--image", image}, {"--json", bus.json}});
    const std::unique_ptr<ControllerClient> client = bus.connect();
    Bytes bytes;
    {
      ProgressBar bar("pulling", bus.quiet);
      bytes = pull_image(*client, bar.callback());
    }
    if (!image.empty()) write_file(image, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    Json result{{"bus", client->where()}, {"bytes", bytes.size()}};
    const std::uint32_t sequence = client->status().active_sequence;
    result["sequence"] = sequence;
    if (!out.empty()) {
      const Robot from_robot = robot_of(*client, robot);
      Calibration calibration = calibration_held(*client, bytes, from_robot);
      stamp(calibration, from_robot);
      save_calibration(out, calibration, from_robot);
      result["terms"] = calibration.terms.terms.size();
    }
    bus.say(fmt::format("{}: set {}, {} bytes, written to {}", client->where(), sequence, bytes.size(),
                        out.empty() ? image : out));
    bus.write_json(result);
  }
};

}  // namespace

void add_pull(CLI::App& app) {
  auto [command, state] = add_command<Pull>(app, "pull", "Read the active set of a controller");
  state.bus.add_bus_to(command, "--from");
  add_value(command, "-o,--output", state.out, "CAL.yaml", "Calibration file to write");
  add_value(command, "--image", state.image, "FILE", "Write the parameter image, byte for byte, to FILE");
  add_optional_robot_option(command, state.robot);
  command.footer("Example:\n  flexcomp pull --from modbus-tcp:10.0.0.7 -o active.yaml");
}

}  // namespace flexcomp::host
