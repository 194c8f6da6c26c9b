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
#include "flexcomp/image.hpp"
#include "json.hpp"
#include "model/parameter_image.hpp"

namespace flexcomp::host {

void Push::check_options() const {
  refuse_same_file({{"CAL.yaml", set}, {"--robot", robot}, {"--against", against}, {"--key", signing.key}},
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
  if (!signing.key.empty() && (confirm || !against.empty()))
    throw CLI::ValidationError("--key", "signs a set that is sent: no --confirm or --against with it");
}

void Push::say_left_out(const std::vector<std::string>& names) const {
  if (names.empty()) return;
  bus.say(fmt::format("{}: left out, for they belong to the measurement: {}", set, fmt::join(names, ", ")));
}

MadeSet Push::make(ControllerClient& client, const std::optional<Bytes>& ready,
                   std::optional<std::uint32_t> number) const {
  if (ready) return {*ready, "", {}};
  const Robot for_robot = robot_of(client, robot);
  const Calibration calibration = load_calibration_for(client, set, for_robot);
  ImageOptions options;
  options.allow_unnamed = allow_unnamed;
  return {make_image(calibration, for_robot, number ? *number : next_sequence(client), options),
          for_robot.serial, never_pushed(calibration, for_robot)};
}

std::pair<std::optional<Bytes>, std::optional<SigningKey>> Push::read_files() const {
  std::optional<Bytes> ready = read_image_file(set);
  if (signing.key.empty()) return {std::move(ready), std::nullopt};
  // A set that is signed for whoever answers protects nothing: the unit has to come from the user.
  if (!ready && robot.empty()) throw CLI::RequiredError("--robot (with --key)");
  if (!ready && load_robot(robot).serial.empty()) {
    throw InputError(robot, 0, "serial", "the serial number of the unit that a set is signed for", "none");
  }
  if (ready && !is_given(image_records(*ready, set).unit_hash))
    throw InputError(set, 0, "", "an image that is bound to one unit, to be signed", "one for any unit");
  return {std::move(ready), signing.signer()};
}

Bytes Push::authorised(ControllerClient& client, const MadeSet& made, const SigningKey* signer,
                       Json& result) const {
  ImageRecords records;
  try {
    records = image_records(made.bytes, set);
  } catch (const InputError&) {
    // Bytes that are no image are the controller's to refuse.
    return made.bytes;
  }
  const std::optional<ControllerUnit> unit = client.unit();
  refuse_other_unit(client, unit, set, records.unit_hash, made.serial);
  const auto to_be_signed = [&](const std::string& why) {
    return BusError(client.where(),
                    fmt::format("{}: sign it by --key with a key that is trusted, {}; nothing was sent", why,
                                keys_text(*unit)));
  };
  Bytes out = made.bytes;
  if (signer != nullptr) {
    refuse_untrusted(client, *unit, signer->id());
    out = sign_image(made.bytes, *signer, signing.next(client, *unit), set);
    records = image_records(out, set);
  } else if (unit && unit->keys != 0) {
    if (!records.is_signed)
      throw to_be_signed(fmt::format("the controller takes only signed sets, and {} is not", set));
    refuse_untrusted(client, *unit, records.key_id);
    if (records.counter <= unit->counter) {
      throw to_be_signed(
          fmt::format("{} was signed with the counter {}, and the controller has accepted {} since", set,
                      records.counter, unit->counter));
    }
  }
  refuse_beyond_capability(client, set, out);
  // A controller need not tell more than the hash, which is equal.
  if (unit && is_given(records.unit_hash))
    result["serial"] = unit->serial.empty() ? made.serial : unit->serial;
  if (records.is_signed) {
    result["key_id"] = text(records.key_id);
    result["counter"] = records.counter;
  }
  return out;
}

std::optional<wire::Status> Push::found_active(ControllerClient& client, const Bytes& bytes) const {
  if (auto now = read_back(client, bytes)) return now;
  // A signature has a counter, which no other has: what is signed again is another image of the same set.
  const wire::Status there = client.status();
  if (there.active_slot == wire::no_slot || there.active_sequence != identity(bytes).sequence)
    return std::nullopt;
  Bytes active;
  try {
    active = client.active_image();
  } catch (const BusError& e) {
    throw OutcomeOpen(client.where(), fmt::format("the active set could not be read: {}", e.text()));
  }
  try {
    if (without_signature(active, client.where()) != without_signature(bytes, set)) return std::nullopt;
  } catch (const InputError&) {
    return std::nullopt;
  }
  auto now = read_back(client, active);
  if (now) bus.say(fmt::format("{}: equal but for its signature, which is not compared", client.where()));
  return now;
}

void Push::say_signed(const Json& result) const {
  if (!result.contains("key_id")) return;
  bus.say(fmt::format("{}: for unit '{}', signed with key {}, counter {}", set, result.value("serial", ""),
                      result["key_id"].get<std::string>(), result["counter"].get<std::uint64_t>()));
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

void Push::send(OutcomeTask& task, const std::optional<Bytes>& ready, const SigningKey* signer) const {
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [start] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  task.client = bus.connect();
  ControllerClient& client = *task.client;
  if (resume) {
    // What an earlier push became, without knowing of it: the file is the same set where it makes the same bytes.
    const wire::Status before = client.settled_status("an earlier push may be at work");
    if (before.active_slot != wire::no_slot) {
      const Bytes bytes = make(client, ready, before.active_sequence).bytes;
      if (const auto now = found_active(client, bytes)) {
        say_active(task, *now, now->active_bytes, false, seconds());
        return;
      }
    }
    task.undecided = false;
  }
  const MadeSet made = make(client, ready, sequence);
  say_left_out(made.left_out);
  task.result["left_out"] = made.left_out;
  const Bytes bytes = authorised(client, made, signer, task.result);
  say_signed(task.result);
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
  const auto [ready, signer] = read_files();
  const SigningKey* const key = signer ? &*signer : nullptr;
  run_to_outcome(
      bus, [&ready = ready, key, this](OutcomeTask& task) { send(task, ready, key); }, resume);
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
  state.signing.add_to(
      command, "Sign the set with this private key, for the unit whose serial is in --robot ROBOT.yaml");
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
      "--resume settles it. A controller that trusts keys takes only what is signed: --key KEY --robot "
      "ROBOT.yaml.\n"
      "Examples:\n"
      "  flexcomp push --to can:vcan0:5 --dry-run cal.yaml\n"
      "  flexcomp push --to can:vcan0:5 cal.yaml\n"
      "  flexcomp push --to can:vcan0:5 --resume cal.yaml\n"
      "  flexcomp push --dry-run --against active.yaml --robot tx60l.yaml cal.yaml");
}

}  // namespace flexcomp::host
