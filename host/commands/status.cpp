// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "commands/bus_options.hpp"
#include "commands/commands.hpp"
#include "commands/key_options.hpp"
#include "flexcomp/bytes.hpp"
#include "json.hpp"
#include "model/calibration.hpp"

namespace flexcomp::host {
namespace {

struct Fault {
  std::uint16_t bit;
  const char* name;
  const char* words;
};
constexpr std::array<Fault, 4> fault_list{{
    {wire::fault::no_valid_set, "no_valid_set",
     "no slot holds a set that this controller accepts: commands pass through"},
    {wire::fault::older_slot, "older_slot", "the newest slot is damaged or was refused: the older set runs"},
    {wire::fault::storage, "storage", "non-volatile memory failed"},
    {wire::fault::trial_reverted, "trial_reverted",
     "a set on trial was not confirmed in time and has reverted"},
}};

std::string version(std::uint32_t v) { return fmt::format("{}.{}.{}", v >> 16U, v >> 8U & 0xFFU, v & 0xFFU); }

void show_status(const BusOptions& bus) {
  const std::unique_ptr<ControllerClient> client = bus.connect();
  const wire::Capability& can = client->capability();
  const wire::Status now = client->status();
  const std::optional<Robot> robot = client->robot();
  const std::optional<ControllerUnit> unit = client->unit();

  const auto state = wire::name(static_cast<wire::StoreState>(now.state));
  const auto answer =
      describe(static_cast<wire::Answer>(now.answer), static_cast<Refusal>(now.refusal), now.detail);
  std::vector<std::string> faults;
  std::string fault_lines;
  for (const Fault& f : fault_list) {
    if ((now.faults & f.bit) == 0) continue;
    faults.emplace_back(f.name);
    fault_lines += fmt::format("\n  fault      {}", f.words);
  }
  Json cycles_by_status;
  std::string cycles;
  for (std::size_t k = 0; k < now.cycles_by_status.size(); ++k) {
    const char* name = flexcomp::name(static_cast<StepStatus>(k));
    cycles_by_status[name] = now.cycles_by_status[k];
    if (now.cycles_by_status[k] != 0) cycles += fmt::format(", {} {}", now.cycles_by_status[k], name);
  }
  std::vector<unsigned> bases;
  for (unsigned k = 0; k < 32; ++k) {
    if ((can.bases >> k & 1U) != 0) bases.push_back(k);
  }

  std::string text = fmt::format("{}: {}, flexcomp {}, {} arithmetic", client->where(),
                                 robot && !robot->name.empty() ? robot->name : "a robot without a name",
                                 version(can.firmware), can.scalar_bytes == 4 ? "single" : "double");
  if (unit) {
    text += fmt::format("\n  unit       {}", unit_text(unit->serial, unit->hash));
    text += fmt::format("\n  trusts     {}", unit->keys == 0 ? "no key: takes sets from everybody"
                                                             : fmt::format("{}; highest counter {}",
                                                                           keys_text(*unit), unit->counter));
  }
  text += now.active_slot == wire::no_slot
              ? "\n  active     no set: commands pass through"
              : fmt::format("\n  active     set {}, {} bytes, CRC {:08x}{}", now.active_sequence,
                            now.active_bytes, now.active_crc,
                            now.settled != 0 ? "" : ", not taken by the control cycle yet");
  if (now.previous_sequence != 0) text += fmt::format("\n  previous   set {}", now.previous_sequence);
  text += fmt::format("\n  store      {}; the last command was: {}", state, answer);
  if (now.trial_cycles_left != 0) {
    text += fmt::format("\n  trial      reverts in {:.1f} s",
                        static_cast<double>(now.trial_cycles_left) * can.cycle_us * 1e-6);
  }
  text += fmt::format("\n  cycle      {} us, {} cycles{}", can.cycle_us, now.cycles, cycles);
  text += fmt::format("\n  holds      {} terms, {} tables, {} table values, {} bytes", can.terms, can.tables,
                      can.values, can.image_bytes);
  bus.say(text + fault_lines);

  bus.write_json({
      {"bus", client->where()},
      {"robot", robot ? Json(robot->name) : Json(nullptr)},
      {"nominal_hash", hex(can.nominal_hash)},
      {"name_hash", hex(can.name_hash)},
      {"firmware", version(can.firmware)},
      {"state", state},
      {"answer", answer},
      {"refusal", now.refusal},
      {"detail", now.detail},
      {"faults", faults},
      {"active",
       {{"slot", now.active_slot == wire::no_slot ? Json(nullptr) : Json(now.active_slot)},
        {"sequence", now.active_sequence},
        {"bytes", now.active_bytes},
        {"crc", fmt::format("{:08x}", now.active_crc)},
        {"settled", now.settled != 0}}},
      {"unit", unit_json(unit)},
      {"previous_sequence", now.previous_sequence},
      {"announced_bytes", now.announced_bytes},
      {"staged_bytes", now.staged_bytes},
      {"trial_cycles_left", now.trial_cycles_left},
      {"cycles", now.cycles},
      {"cycles_by_status", cycles_by_status},
      {"last_status", flexcomp::name(static_cast<StepStatus>(now.last_status))},
      {"capability",
       {{"protocol", fmt::format("{}.{}", can.protocol >> 8U, can.protocol & 0xFFU)},
        {"schema", fmt::format("{}.{}", can.schema >> 8U, can.schema & 0xFFU)},
        {"scalar_bytes", can.scalar_bytes},
        {"bases", bases},
        {"terms", can.terms},
        {"tables", can.tables},
        {"values", can.values},
        {"image_bytes", can.image_bytes},
        {"cycle_us", can.cycle_us},
        {"fade_cycles", can.fade_cycles},
        {"plausible_position_m", double_of(can.plausible_position_m)},
        {"plausible_orientation_rad", double_of(can.plausible_orientation_rad)},
        {"largest_correction_rad", double_of(can.largest_correction_rad)}}},
  });
}

}  // namespace

void add_status(CLI::App& app) {
  auto state = std::make_shared<BusOptions>();
  CLI::App* command = app.add_subcommand("status", "What a controller is, holds and does");
  state->add_bus_to(*command, "--of");
  command->footer("Example:\n  flexcomp status --of modbus-rtu:/dev/ttyUSB0:115200:N:3");
  command->callback([state] { show_status(*state); });
}

}  // namespace flexcomp::host
