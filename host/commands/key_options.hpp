// SPDX-License-Identifier: Apache-2.0
/// \file
/// Options of the commands that sign what they send, and what a controller asks for before it lets a set be destroyed.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>

#include "commands/outcome.hpp"
#include "signing/signed_bytes.hpp"

namespace flexcomp::host {

struct KeyOptions {
  std::string key;
  std::optional<std::uint64_t> counter;

  void add_to(CLI::App& app, const std::string& what);
  /// Nothing where no key was given. \throws InputError
  std::optional<SigningKey> signer() const;

  /// The counter of the next signature for a unit. \throws BusError  the unit's own is not plausible, or not below --counter
  std::uint64_t next(const ControllerClient& client, const ControllerUnit& unit) const;

  /// Does what this controller asks for before a rollback or erase that follows at once: an unlock, a signed command, or
  /// nothing. \throws BusError
  void authorise(OutcomeTask& task, wire::Command command, const SigningKey* signer) const;
};

/// \throws BusError  a controller is known not to trust a key; nothing was sent
void refuse_untrusted(const ControllerClient& client, const ControllerUnit& unit, const KeyId& key);

/// "2 keys (0123456789abcdef, 8899aabbccddeeff)", for messages.
std::string keys_text(const ControllerUnit& unit);

/// "unit" of JSON results; null where a controller does not tell.
Json unit_json(const std::optional<ControllerUnit>& unit);

}  // namespace flexcomp::host
