// SPDX-License-Identifier: Apache-2.0
// push --dry-run: what a push would change.
#include <fmt/format.h>

#include <memory>

#include "bus/transfer.hpp"
#include "commands/progress_bar.hpp"
#include "commands/push.hpp"
#include "commands/result_text.hpp"
#include "files/calibration_file.hpp"
#include "files/robot_file.hpp"
#include "json.hpp"
#include "model/admission.hpp"
#include "model/parameter_image.hpp"
#include "model/set_difference.hpp"

namespace flexcomp::host {

namespace {

/// The tool is looked at in so many poses.
constexpr std::size_t dry_run_poses = 500;

/// A set of parameters as a controller holds it, from a file: a calibration, or an image.
TermSet held_set(const std::string& path, const Robot& robot, const ImageOptions& options) {
  const std::optional<Bytes> image = read_image_file(path);
  const Bytes bytes = image ? *image : make_image(load_calibration(path, robot), robot, 1, options);
  return calibration_from_image(bytes, robot, path).terms;
}

}  // namespace

/// Reads and compares; not one byte is written to the controller.
void Push::show_changes() const {
  Json result{{"dry_run", true}};
  std::vector<std::string> left_out;
  Robot for_robot;
  TermSet now;
  TermSet next;
  if (against.empty()) {
    const auto [ready, signer] = read_files();
    const std::unique_ptr<ControllerClient> client = bus.connect();
    for_robot = robot_of(*client, robot);
    const MadeSet made = make(*client, ready, sequence);
    left_out = made.left_out;
    // A file that is no image is the file's fault; what a sound one asks for may be beyond the controller.
    next = calibration_from_image(made.bytes, for_robot, set).terms;
    const Bytes bytes = authorised(*client, made, signer ? &*signer : nullptr, result);
    const wire::Status status = client->status();
    Bytes active;
    if (status.active_slot != wire::no_slot) {
      ProgressBar bar("reading the active set", bus.quiet);
      active = client->active_image(bar.callback());
    }
    if (!active.empty()) now = calibration_held(*client, active, for_robot).terms;
    const std::string before =
        active.empty() ? "no set, commands pass through" : fmt::format("set {}", status.active_sequence);
    say_signed(result);
    bus.say(fmt::format("{}: holds {}; {} would be sent ({} bytes). Nothing was sent.", client->where(),
                        before, set, bytes.size()));
    result["bus"] = client->where();
    result["sequence"] = active.empty() ? 0U : status.active_sequence;
    result["bytes"] = bytes.size();
  } else {
    if (robot.empty()) throw CLI::RequiredError("--robot (with --against)");
    for_robot = load_robot(robot);
    ImageOptions options;
    options.allow_unnamed = allow_unnamed;
    next = held_set(set, for_robot, options);
    options.allow_inadmissible = true;
    now = held_set(against, for_robot, options);
    bus.say(fmt::format("{}: would take the place of {}. Nothing was sent.", set, against));
    result["against"] = against;
  }
  const HostCertificate certificate = certified(next, for_robot, set);
  const SetDifference d = difference(now, next, for_robot, dry_run_poses);
  say_left_out(left_out);
  bus.say(difference_table(d));
  bus.say(certificate_text(certificate));
  result["left_out"] = left_out;
  result.update(to_json(d));
  result["certificate"] = to_json(certificate);
  bus.write_json(result);
}

}  // namespace flexcomp::host
