#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "bus/transfer.hpp"
#include "commands/bus_options.hpp"
#include "commands/commands.hpp"
#include "commands/progress_bar.hpp"
#include "files/calibration_file.hpp"
#include "files/image.hpp"
#include "files/write_file.hpp"
#include "flexcomp/bytes.hpp"

namespace flexcomp::host {
namespace {

struct Push {
  BusOptions bus;
  std::string set;
  std::string robot;
  std::string image;
  std::optional<std::uint32_t> sequence;
  std::optional<double> trial_s;
  bool confirm = false;
  bool allow_unnamed = false;

  void run() const;
  Bytes make(ControllerClient& client, std::vector<std::string>& left_out) const;
};

Bytes Push::make(ControllerClient& client, std::vector<std::string>& left_out) const {
  const RobotFile for_robot = robot_of(client, robot);
  const Calibration calibration = load_calibration_for(client, set, for_robot);
  left_out = never_pushed(calibration, for_robot);
  ImageOptions options;
  options.allow_unnamed = allow_unnamed;
  Bytes out = make_image(calibration, for_robot, sequence ? *sequence : next_sequence(client), options);
  const std::vector<std::string> beyond = beyond_capability(client.capability(), out);
  if (!beyond.empty()) {
    throw BusError(fmt::format("{}: {} is more than this controller can do: {}; nothing was sent",
                               client.where(), set, fmt::join(beyond, "; ")));
  }
  return out;
}

void Push::run() const {
  const auto start = std::chrono::steady_clock::now();
  if (set.empty() != confirm)
    throw CLI::ValidationError("CAL.yaml", "give either a set to push or --confirm");
  // A file that cannot be read is said before anybody is asked.
  const std::optional<Bytes> ready = confirm ? std::nullopt : read_image_file(set);
  const std::unique_ptr<ControllerClient> client = bus.connect();
  nlohmann::ordered_json result{{"bus", client->where()}};
  if (confirm) {
    client->run(wire::Command::confirm);
    const std::uint32_t active = client->status().active_sequence;
    result["sequence"] = active;
    bus.say(fmt::format("{}: set {} is confirmed", client->where(), active));
    bus.write_json(result);
    return;
  }

  std::vector<std::string> left_out;
  const Bytes bytes = ready ? *ready : make(*client, left_out);
  if (!left_out.empty()) {
    bus.say(
        fmt::format("{}: left out, for they belong to the measurement: {}", set, fmt::join(left_out, ", ")));
  }
  if (!image.empty()) {
    write_file(image, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }
  PushOptions options;
  if (trial_s) {
    const double cycles =
        std::ceil(*trial_s * 1e6 / std::max<std::uint32_t>(client->capability().cycle_us, 1));
    if (cycles > std::numeric_limits<std::uint32_t>::max()) {
      throw CLI::ValidationError("--trial", "so long a trial cannot be counted");
    }
    options.trial_cycles = static_cast<std::uint32_t>(cycles);
  }
  {
    ProgressBar bar("pushing", bus.quiet);
    options.progress = bar.callback();
    push_image(*client, bytes, options);
  }
  const wire::Status now = client->status();
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  result["sequence"] = now.active_sequence;
  result["bytes"] = bytes.size();
  result["crc"] = fmt::format("{:08x}", now.active_crc);
  result["left_out"] = left_out;
  result["trial"] = trial_s.has_value();
  result["seconds"] = took.count();
  bus.say(fmt::format("{}: set {} is active{}: {} bytes, read back and equal, {:.2f} s", client->where(),
                      now.active_sequence,
                      trial_s ? fmt::format(" on trial (confirm within {:.1f} s: push --to {} --confirm)",
                                            *trial_s, client->where())
                              : "",
                      bytes.size(), took.count()));
  bus.write_json(result);
}

}  // namespace

void add_push(CLI::App& app) {
  auto state = std::make_shared<Push>();
  CLI::App* command = app.add_subcommand(
      "push", "Send a calibration to a controller: staged, verified, committed, read back and compared");
  state->bus.add_bus_to(*command, "--to");
  command->add_option("set", state->set, "Calibration file, or a parameter image as pull --image writes it")
      ->type_name("CAL.yaml");
  add_optional_robot_option(*command, state->robot);
  command->add_option("--sequence", state->sequence,
                      "Number of the set; by default one more than the newest there");
  command->add_option("--image", state->image, "Write the bytes that are sent to FILE")->type_name("FILE");
  command
      ->add_option("--trial", state->trial_s,
                   "On trial: the set before comes back unless confirmed within this time [s]")
      ->check(CLI::PositiveNumber);
  command->add_flag("--confirm", state->confirm, "Keep the set that runs on trial; no CAL.yaml then");
  command->add_flag("--allow-unnamed", state->allow_unnamed, "Also push what was found but not understood");
  command->footer("Example:\n  flexcomp push --to can:vcan0:5 cal.yaml");
  command->callback([state] { state->run(); });
}

}  // namespace flexcomp::host
