#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "bus/progress_bar.hpp"
#include "bus/transfer.hpp"
#include "commands/bus_options.hpp"
#include "files/calibration_file.hpp"
#include "files/image.hpp"
#include "files/write_file.hpp"

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
    const std::unique_ptr<ControllerClient> client = bus.connect();
    Bytes bytes;
    {
      ProgressBar bar("pulling", bus.quiet);
      bytes = pull_image(*client, bar.callback());
    }
    if (!image.empty()) write_file(image, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    nlohmann::ordered_json result{{"bus", client->where()}, {"bytes", bytes.size()}};
    const std::uint32_t sequence = client->status().active_sequence;
    result["sequence"] = sequence;
    if (!out.empty()) {
      const RobotFile from_robot = robot_of(*client, robot);
      try {
        Calibration calibration = calibration_from_image(bytes, from_robot, client->where());
        stamp(calibration, from_robot);
        save_calibration(out, calibration, from_robot);
        result["terms"] = calibration.terms.terms.size();
      } catch (const InputError& e) {
        // The bytes came from the controller: it is no file of the user's that is refused.
        throw BusError(e.what());
      }
    }
    bus.say(fmt::format("{}: set {}, {} bytes, written to {}", client->where(), sequence, bytes.size(),
                        out.empty() ? image : out));
    bus.write_json(result);
  }
};

}  // namespace

void add_pull(CLI::App& app) {
  auto state = std::make_shared<Pull>();
  CLI::App* command = app.add_subcommand("pull", "read the active set back from a controller");
  state->bus.add_to(*command, "--from");
  command->add_option("-o,--out", state->out, "calibration file to write")->type_name("CAL.yaml");
  command->add_option("--image", state->image, "write the bytes as they are to this file")->type_name("FILE");
  command
      ->add_option("--robot", state->robot, "robot file; by default the controller tells which arm it is for")
      ->type_name("R.yaml");
  command->callback([state] { state->run(); });
}

}  // namespace flexcomp::host
