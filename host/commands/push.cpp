// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "bus/transfer.hpp"
#include "commands/commands.hpp"
#include "commands/progress_bar.hpp"
#include "commands/push.hpp"
#include "files/calibration_file.hpp"
#include "files/robot_file.hpp"
#include "files/write_file.hpp"
#include "flexcomp/bytes.hpp"
#include "json.hpp"
#include "model/parameter_image.hpp"

namespace flexcomp::host {

void Push::check_options() const {
  refuse_same_file({{"CAL.yaml", set}, {"--robot", robot}, {"--against", against}},
                   {{"--image", image}, {"--json", bus.json}});
  if (set.empty() != confirm)
    throw CLI::ValidationError("CAL.yaml", "give either a set to push or --confirm");
  if (!against.empty() && !dry_run)
    throw CLI::ValidationError("--against", "compares with a file, which only --dry-run does");
  if (!against.empty() && to->count() != 0)
    throw CLI::ValidationError("--against", "compares with a file: no --to with it");
  if (to->count() == 0 && against.empty()) throw CLI::RequiredError("--to");
  if (dry_run && (confirm || trial_s || !image.empty()))
    throw CLI::ValidationError("--dry-run",
                               "sends and writes nothing: no --trial, --confirm or --image with it");
}

void Push::say_left_out(const std::vector<std::string>& names) const {
  if (names.empty()) return;
  bus.say(fmt::format("{}: left out, for they belong to the measurement: {}", set, fmt::join(names, ", ")));
}

Bytes Push::make(ControllerClient& client, std::vector<std::string>& left_out) const {
  const Robot for_robot = robot_of(client, robot);
  const Calibration calibration = load_calibration_for(client, set, for_robot);
  left_out = never_pushed(calibration, for_robot);
  ImageOptions options;
  options.allow_unnamed = allow_unnamed;
  Bytes out = make_image(calibration, for_robot, sequence ? *sequence : next_sequence(client), options);
  refuse_beyond_capability(client, set, out);
  return out;
}

void Push::run() const {
  const auto start = std::chrono::steady_clock::now();
  check_options();
  if (dry_run) {
    show_changes();
    return;
  }
  // A file that cannot be read is said before anybody is asked.
  const std::optional<Bytes> ready = confirm ? std::nullopt : read_image_file(set);
  const std::unique_ptr<ControllerClient> client = bus.connect();
  Json result{{"bus", client->where()}};
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
  say_left_out(left_out);
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

void add_push(CLI::App& app) {
  auto [command, state] = add_command<Push>(
      app, "push", "Send a calibration to a controller: staged, verified, committed, read back and compared");
  state.bus.add_bus_to(command, "--to");
  state.to = command.get_option("--to")->required(false);
  add_value(command, "set", state.set, "CAL.yaml",
            "Calibration file, or a parameter image as pull --image writes it");
  add_optional_robot_option(command, state.robot);
  command.add_option("--sequence", state.sequence,
                     "Number of the set; by default one more than the newest there");
  add_value(command, "--image", state.image, "FILE", "Write the bytes that are sent to FILE");
  command
      .add_option("--trial", state.trial_s,
                  "On trial: the set before comes back unless confirmed within this time [s]")
      ->check(positive_number());
  command.add_flag("--confirm", state.confirm, "Keep the set that runs on trial; no CAL.yaml then");
  command.add_flag("--allow-unnamed", state.allow_unnamed, "Also push what was found but not understood");
  command.add_flag(
      "--dry-run", state.dry_run,
      "Send nothing: show what would change, old -> new, and what that does at the tool in mm and degrees");
  add_value(command, "--against", state.against, "CAL.yaml",
            "With --dry-run: compare with this file (of pull) instead of a controller");
  command.footer(
      "Examples:\n"
      "  flexcomp push --to can:vcan0:5 --dry-run cal.yaml\n"
      "  flexcomp push --to can:vcan0:5 cal.yaml\n"
      "  flexcomp push --dry-run --against active.yaml --robot tx60l.yaml cal.yaml");
}

}  // namespace flexcomp::host
