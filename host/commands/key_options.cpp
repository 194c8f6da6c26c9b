// SPDX-License-Identifier: Apache-2.0
#include "commands/key_options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <vector>

#include "bus/transfer.hpp"
#include "flexcomp/image.hpp"
#include "model/calibration.hpp"

namespace flexcomp::host {

namespace {

std::vector<std::string> ids_of(const ControllerUnit& unit) {
  std::vector<std::string> out;
  for (const KeyId& id : unit.key_ids) out.push_back(text(id));
  return out;
}

}  // namespace

void KeyOptions::add_to(CLI::App& app, const std::string& what) {
  CLI::Option* const of_key = app.add_option("--key", key, what)->type_name("KEY");
  // CLI11 itself takes -1 and what is beyond 64 bits for the greatest number.
  app.add_option_function<std::string>(
         "--counter",
         [this](const std::string& text) {
           std::uint64_t value = 0;
           const char* const end = text.data() + text.size();
           const auto [at, error] = std::from_chars(text.data(), end, value);
           if (error != std::errc() || at != end)
             throw CLI::ValidationError("--counter", fmt::format("'{}' is no whole number of 64 bits", text));
           counter = value;
         },
         "Counter of the signature; by default the Unix time in ms, or one more than the controller's")
      ->type_name("NUMBER")
      ->needs(of_key);
}

std::optional<SigningKey> KeyOptions::signer() const {
  if (key.empty()) return std::nullopt;
  return SigningKey::read(key);
}

std::uint64_t KeyOptions::next(const ControllerClient& client, const ControllerUnit& unit) const {
  if (counter) {
    if (*counter > unit.counter) return *counter;
    throw BusError(
        client.where(),
        fmt::format("--counter {} is not above the highest one that the controller has accepted, {}; nothing "
                    "was sent",
                    *counter, unit.counter));
  }
  const auto now = std::chrono::system_clock::now();
  const std::uint64_t out = next_counter(unit.counter, now);
  if (out != 0 && is_plausible_counter(unit.counter, now)) return out;
  throw BusError(client.where(),
                 fmt::format("the controller tells a counter of {}, more than a day ahead of this computer's "
                             "clock: the clock is "
                             "wrong, or who answers is not the controller. Where both are right, --counter "
                             "{} goes on from there; "
                             "nothing was sent",
                             unit.counter, unit.counter + 2 <= 1 ? "N" : std::to_string(unit.counter + 1)));
}

void KeyOptions::authorise(OutcomeTask& task, wire::Command command, const SigningKey* signer) const {
  ControllerClient& client = *task.client;
  const std::optional<ControllerUnit> unit = client.unit();
  if (!unit || unit->keys == 0) {
    if (signer != nullptr) {
      throw BusError(client.where(),
                     unit ? "the controller trusts no key: without --key it is unlocked instead"
                          : "this firmware knows no signed commands: leave --key out");
    }
    if (!unit) return;
  }
  const wire::Status now = client.status();
  if (command == wire::Command::rollback && now.state == static_cast<std::uint16_t>(wire::StoreState::trial))
    return;
  if (unit->keys == 0) {
    unlock(client);
    return;
  }
  // Without a key: the integrator's own code may permit it all the same.
  if (signer == nullptr) return;
  refuse_untrusted(client, *unit, signer->id());
  if (!is_given(unit->hash))
    throw BusError(client.where(), "the controller has no serial number, so no command can be signed for it");
  SignedCommand signed_command;
  signed_command.command = static_cast<std::uint16_t>(command);
  signed_command.active_crc = now.active_slot == wire::no_slot ? 0 : now.active_crc;
  signed_command.counter = next(client, *unit);
  signed_command.unit_hash = unit->hash;
  task.result["serial"] = unit->serial;
  task.result["key_id"] = text(signer->id());
  task.result["counter"] = signed_command.counter;
  stage_verified(client, sign_command(signed_command, *signer));
}

void refuse_untrusted(const ControllerClient& client, const ControllerUnit& unit, const KeyId& key) {
  // Of more keys than are listed this one may be among the others; the controller will say. Where none is trusted, a signature
  // is not asked for.
  const bool all_listed = unit.keys <= unit.key_ids.size();
  const bool listed = std::find(unit.key_ids.begin(), unit.key_ids.end(), key) != unit.key_ids.end();
  if (unit.keys == 0 || listed || !all_listed) return;
  throw BusError(client.where(), fmt::format("the controller trusts {}, not {}; nothing was sent",
                                             keys_text(unit), text(key)));
}

std::string keys_text(const ControllerUnit& unit) {
  if (unit.keys == 0) return "no key";
  return fmt::format("{} ({}{})", unit.keys == 1 ? "one key" : fmt::format("{} keys", unit.keys),
                     fmt::join(ids_of(unit), ", "), unit.keys > unit.key_ids.size() ? ", …" : "");
}

Json unit_json(const std::optional<ControllerUnit>& unit) {
  if (!unit) return nullptr;
  return {{"serial", unit->serial},
          {"unit_hash", is_given(unit->hash) ? hex(unit->hash) : ""},
          {"keys", unit->keys},
          {"key_ids", ids_of(*unit)},
          {"counter", unit->counter}};
}

}  // namespace flexcomp::host
