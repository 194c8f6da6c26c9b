// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>

#include "bus/transfer.hpp"
#include "commands/answers.hpp"
#include "commands/bus_options.hpp"
#include "commands/commands.hpp"
#include "commands/progress_bar.hpp"
#include "files/data_file.hpp"
#include "files/write_file.hpp"
#include "flexcomp/bytes.hpp"
#include "json.hpp"
#include "kinematics/nominal_inverse.hpp"

namespace flexcomp::host {
namespace {

struct Probe {
  BusOptions bus;
  std::string robot;
  std::string targets;
  std::string out;
  bool force = false;

  void run() const;
};

template <std::size_t N>
std::array<std::uint64_t, N> all_bits(const std::array<double, N>& values) {
  std::array<std::uint64_t, N> out{};
  std::transform(values.begin(), values.end(), out.begin(), bits_of);
  return out;
}

wire::ProbeRequest request_of(const std::array<double, joint_count>& q_rad,
                              const Context<double, joint_count>& context) {
  wire::ProbeRequest out;
  out.q_rad = all_bits(q_rad);
  out.payload_kg = bits_of(context.payload_kg);
  out.payload_com_m = all_bits(context.payload_com_m);
  out.force_n = all_bits(context.force_n);
  out.temperature_c = bits_of(context.temperature_c);
  out.time_s = bits_of(context.time_s);
  out.direction = all_bits(context.direction);
  out.relative_speed = all_bits(context.relative_speed);
  return out;
}

void Probe::run() const {
  refuse_same_file({{"--robot", robot}, {"--targets", targets}}, {{"-o", out}, {"--json", bus.json}});
  const std::unique_ptr<ControllerClient> client = bus.connect();
  // Limits, seeds and the defaults of the context are the robot's.
  const Robot from = robot_of(*client, robot);
  const TargetsFile list = load_targets(targets, from, {force});
  bus.warn(list.warnings);
  const auto commands = joint_commands(list, from);

  std::vector<Answer> answers;
  std::uint32_t sequence = 0;
  const auto start = std::chrono::steady_clock::now();
  {
    ProgressBar bar("probing", bus.quiet);
    for (std::size_t k = 0; k < commands.size(); ++k) {
      const wire::ProbeResponse response = client->probe(request_of(commands[k], list.rows[k].context));
      if (k != 0 && response.sequence != sequence) {
        throw BusError(
            client->where(),
            fmt::format("the controller changed from set {} to set {} after {} of {} targets; nothing "
                        "was written",
                        sequence, response.sequence, k, commands.size()));
      }
      sequence = response.sequence;
      Answer answer;
      std::transform(response.q_rad.begin(), response.q_rad.end(), answer.q_rad.begin(), double_of);
      answer.residual_m = double_of(response.position_m);
      answer.residual_rad = double_of(response.orientation_rad);
      answer.status = static_cast<StepStatus>(response.status);
      answer.flags = response.flags;
      answers.push_back(answer);
      bar.show(k + 1, commands.size());
    }
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  write_file(out, answers_text(list, answers));
  Json summary{{"bus", client->where()}, {"sequence", sequence}, {"seconds", took.count()}};
  summary.update(answers_summary(commands, answers));
  bus.say(fmt::format(
      "{}: {} targets answered by set {} in {:.2f} s, {} of them ok; largest correction {:.4f} deg, "
      "largest residual {:.2g} mm",
      client->where(), answers.size(), sequence, took.count(), summary["status"]["ok"].get<int>(),
      summary["largest_correction_deg"].get<double>(), summary["residual_max_mm"].get<double>()));
  bus.write_json(summary);
}

}  // namespace

void add_probe(CLI::App& app) {
  auto [command, state] =
      add_command<Probe>(app, "probe", "What the running controller itself answers to targets");
  state.bus.add_bus_to(command, "--at");
  add_value(command, "--targets", state.targets, "T.csv", "Targets, as for compensate")->required();
  add_value(command, "-o,--output", state.out, "OUT.csv", "The same columns as compensate writes")
      ->required();
  add_optional_robot_option(command, state.robot);
  command.add_flag("--force", state.force,
                   "Go on where input is only suspicious (joints that look like radians)");
  command.footer("Example:\n  flexcomp probe --at can:vcan0:5 --targets t.csv -o answers.csv");
}

}  // namespace flexcomp::host
