// SPDX-License-Identifier: Apache-2.0
// keygen and trust: the keys that sets and commands are signed with.
#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "commands/bus_options.hpp"
#include "commands/commands.hpp"
#include "commands/key_options.hpp"
#include "files/write_file.hpp"
#include "json.hpp"
#include "signing/keys.hpp"

namespace flexcomp::host {
namespace {

struct Keygen {
  CommonOptions common;
  std::string out;

  void run() const {
    refuse_same_file({}, {{"-o", out}, {"--json", common.json}});
    const SigningKey key = SigningKey::generate();
    key.write(out);
    common.say(
        fmt::format("{}: private key, for who signs alone; {}.pub: public key, for controllers\nkey id {}",
                    out, out, text(key.id())));
    common.write_json({{"key", out}, {"public_key", out + ".pub"}, {"key_id", text(key.id())}});
  }
};

std::string key_header(const std::vector<std::string>& files, const std::vector<PublicKey>& keys) {
  std::string out =
      "/* Public keys of those whose parameter sets and commands a controller accepts, written by \"flexcomp "
      "trust\".\n";
  for (const PublicKey& key : keys) out += fmt::format(" * key id {}\n", text(id_of(key)));
  out += fmt::format(
      " */\n/* clang-format off */\n#ifndef FLEXCOMP_TRUSTED_KEY_H\n#define "
      "FLEXCOMP_TRUSTED_KEY_H\n\n#include "
      "<stdint.h>\n\nstatic const uint8_t flexcomp_trusted_keys[{}][{}] = {{\n",
      files.size(), signing::key_bytes);
  for (const PublicKey& key : keys) {
    for (std::size_t k = 0; k < key.size(); ++k) {
      out += fmt::format("{}0x{:02x}{}",
                         k == 0        ? "    {"
                         : k % 16 == 0 ? "     "
                                       : " ",
                         key[k],
                         k + 1 == key.size() ? "},\n"
                         : k % 16 == 15      ? ",\n"
                                             : ",");
    }
  }
  return out + "};\n\n#endif\n";
}

/// What a controller says of a key: nothing where it trusts more than it lists.
std::optional<bool> is_trusted(const ControllerUnit& unit, const KeyId& key) {
  if (std::find(unit.key_ids.begin(), unit.key_ids.end(), key) != unit.key_ids.end()) return true;
  if (unit.keys > unit.key_ids.size()) return std::nullopt;
  return false;
}

struct Trust {
  BusOptions bus;
  std::vector<std::string> files;
  std::string out;
  const CLI::Option* at = nullptr;

  void run() const {
    std::vector<NamedFile> inputs;
    for (const std::string& file : files) inputs.push_back({"KEY.pub", file});
    refuse_same_file(inputs, {{"-o", out}, {"--json", bus.json}});
    std::vector<PublicKey> keys;
    Json list = Json::array();
    for (const std::string& file : files) {
      keys.push_back(read_public_key(file));
      if (std::find(keys.begin(), keys.end() - 1, keys.back()) != keys.end() - 1)
        throw InputError(file, 0, "", "different keys", "one that was given before");
      list.push_back({{"file", file}, {"key_id", text(id_of(keys.back()))}});
      bus.say(fmt::format("{}: key id {}", file, text(id_of(keys.back()))));
    }
    Json result{{"keys", list}};
    if (!out.empty()) {
      write_file(out, key_header(files, keys));
      bus.say(fmt::format("{}: C array flexcomp_trusted_keys[{}]", out, keys.size()));
      result["output"] = out;
    }
    if (at->count() != 0) ask(keys, result);
    bus.write_json(result);
  }

  void ask(const std::vector<PublicKey>& keys, Json& result) const {
    const auto client = bus.connect();
    const std::optional<ControllerUnit> unit = client->unit();
    result["bus"] = client->where();
    result["unit"] = unit_json(unit);
    if (!unit) {
      bus.say(fmt::format("{}: this firmware trusts no keys: it takes sets from everybody", client->where()));
    } else {
      bus.say(fmt::format("{}: {} trusts {}; highest counter {}", client->where(),
                          unit_text(unit->serial, unit->hash), keys_text(*unit), unit->counter));
    }
    for (std::size_t k = 0; k < keys.size(); ++k) {
      const std::optional<bool> trusted = unit ? is_trusted(*unit, id_of(keys[k])) : false;
      result["keys"][k]["trusted"] = trusted ? Json(*trusted) : Json(nullptr);
      bus.say(fmt::format("{}: {}", files[k],
                          !trusted   ? "not among the first that the controller lists"
                          : *trusted ? "trusted"
                                     : "not trusted"));
    }
  }
};

}  // namespace

void add_keygen(CLI::App& app) {
  auto [command, state] =
      add_command<Keygen>(app, "keygen", "Make a key pair that signs what is sent to controllers");
  add_value(command, "-o,--output", state.out, "KEY",
            "Private key to write, which only you can read, and beside it KEY.pub; both must be new")
      ->required();
  state.common.add_to(command);
  command.footer(
      "PEM files of an Ed25519 key; \"openssl pkey -in KEY -aes256 -out ENCRYPTED\" puts a passphrase on it, "
      "which is "
      "asked for on the terminal or taken from FLEXCOMP_KEY_PASSPHRASE.\n"
      "Example:\n  flexcomp keygen -o arm.key");
}

void add_trust(CLI::App& app) {
  auto [command, state] = add_command<Trust>(
      app, "trust", "Public keys for the firmware of a controller, and whether one that runs trusts them");
  state.bus.add_bus_to(command, "--at");
  state.at = command.get_option("--at")->required(false);
  command.add_option("keys", state.files, "Public keys, as keygen writes them")
      ->required()
      ->type_name("KEY.pub");
  add_value(command, "-o,--output", state.out, "KEYS.h", "Write them as an array in C, for the firmware");
  command.footer(
      "Examples:\n"
      "  flexcomp trust arm.key.pub -o flexcomp_trusted_key.h\n"
      "  flexcomp trust arm.key.pub --at can:vcan0:5");
}

}  // namespace flexcomp::host
