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
  if (resume && (confirm || dry_run))
    throw CLI::ValidationError("--resume", "settles a push: no --confirm or --dry-run with it");
  if (resume && sequence)
    throw CLI::ValidationError("--resume",
                               "compares with the active set by its number: no --sequence with it");
  if (dry_run && (confirm || trial_s || !image.empty()))
    throw CLI::ValidationError("--dry-run",
                               "sends and writes nothing: no --trial, --confirm or --image with it");
}

void Push::say_left_out(const std::vector<std::string>& names) const {
  if (names.empty()) return;
  bus.say(fmt::format("{}: left out, for they belong to the measurement: {}", set, fmt::join(names, ", ")));
}

Bytes Push::make(ControllerClient& client, std::vector<std::string>& left_out,
                 std::optional<std::uint32_t> number) const {
  const Robot for_robot = robot_of(client, robot);
  const Calibration calibration = load_calibration_for(client, set, for_robot);
  left_out = never_pushed(calibration, for_robot);
  ImageOptions options;
  options.allow_unnamed = allow_unnamed;
  Bytes out = make_image(calibration, for_robot, number ? *number : next_sequence(client), options);
  refuse_beyond_capability(client, set, out);
  return out;
}

void Push::say_active(OutcomeTask& task, const wire::Status& now, std::size_t bytes, bool sent,
                      double seconds) const {
  const std::string& where = task.client->where();
  const bool on_trial = now.state == static_cast<std::uint16_t>(wire::StoreState::trial);
  task.result["sequence"] = now.active_sequence;
  task.result["bytes"] = bytes;
  task.result["crc"] = fmt::format("{:08x}", now.active_crc);
  task.result["trial"] = on_trial;
  task.result["sent"] = sent;
  task.result["seconds"] = seconds;
  const double left_s = now.trial_cycles_left * 1e-6 * task.client->capability().cycle_us;
  bus.say(fmt::format("{}: set {} is active{}: {} bytes, read back and equal{}, {:.2f} s", where,
                      now.active_sequence,
                      on_trial ? fmt::format(" on trial (confirm within {:.1f} s: push --to {} --confirm)",
                                             sent ? *trial_s : left_s, where)
                               : "",
                      bytes, sent ? "" : ", nothing was sent", seconds));
}

void Push::send(OutcomeTask& task, const std::optional<Bytes>& ready) const {
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [start] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  task.client = bus.connect();
  ControllerClient& client = *task.client;
  std::vector<std::string> left_out;
  if (resume) {
    // What an earlier push became, without knowing of it: the file is the same set where it makes the same bytes.
    const wire::Status before = client.settled_status("an earlier push may be at work");
    if (before.active_slot != wire::no_slot) {
      const Bytes bytes = ready ? *ready : make(client, left_out, before.active_sequence);
      if (const auto now = read_back(client, bytes)) {
        say_active(task, *now, bytes.size(), false, seconds());
        return;
      }
    }
    task.undecided = false;
  }
  const Bytes bytes = ready ? *ready : make(client, left_out, sequence);
  say_left_out(left_out);
  task.result["left_out"] = left_out;
  if (!image.empty()) {
    write_file(image, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }
  PushOptions options;
  if (trial_s) {
    const double cycles =
        std::ceil(*trial_s * 1e6 / std::max<std::uint32_t>(client.capability().cycle_us, 1));
    if (cycles > std::numeric_limits<std::uint32_t>::max()) {
      throw CLI::ValidationError("--trial", "so long a trial cannot be counted");
    }
    options.trial_cycles = static_cast<std::uint32_t>(cycles);
  }
  wire::Status now;
  {
    ProgressBar bar("pushing", bus.quiet);
    options.progress = bar.callback();
    now = push_image(client, bytes, options);
  }
  say_active(task, now, bytes.size(), true, seconds());
}

void Push::run() const {
  check_options();
  if (dry_run) {
    show_changes();
    return;
  }
  if (confirm) {
    run_to_outcome(bus, [this](OutcomeTask& task) {
      task.client = bus.connect();
      const std::uint32_t active = confirm_trial(*task.client).active_sequence;
      task.result["sequence"] = active;
      bus.say(fmt::format("{}: set {} is confirmed", task.client->where(), active));
    });
    return;
  }
  // A file that cannot be read is said before anybody is asked.
  const std::optional<Bytes> ready = read_image_file(set);
  run_to_outcome(
      bus, [&](OutcomeTask& task) { send(task, ready); }, resume);
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
  command.add_flag(
      "--resume", state.resume,
      "Settle a push that ended open, or was cut off: nothing is sent where CAL.yaml is already active, "
      "byte for byte; else it is pushed again");
  command.add_flag("--allow-unnamed", state.allow_unnamed, "Also push what was found but not understood");
  command.add_flag(
      "--dry-run", state.dry_run,
      "Send nothing: show what would change, old -> new, and what that does at the tool in mm and degrees");
  add_value(command, "--against", state.against, "CAL.yaml",
            "With --dry-run: compare with this file (of pull) instead of a controller");
  command.footer(
      "A push ends in one of three words (JSON \"outcome\"): active, read back and equal, exit status 0; "
      "refused, the "
      "set before runs, 4; open, it cannot be told now what the controller made of the commit, 5: \"flexcomp "
      "status\" or "
      "--resume settles it.\n"
      "Examples:\n"
      "  flexcomp push --to can:vcan0:5 --dry-run cal.yaml\n"
      "  flexcomp push --to can:vcan0:5 cal.yaml\n"
      "  flexcomp push --to can:vcan0:5 --resume cal.yaml\n"
      "  flexcomp push --dry-run --against active.yaml --robot tx60l.yaml cal.yaml");
}

}  // namespace flexcomp::host
