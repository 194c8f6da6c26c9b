// SPDX-License-Identifier: Apache-2.0
#include "bus/transfer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <limits>
#include <set>
#include <system_error>

#include "files/robot_file.hpp"
#include "files/yaml_field.hpp"
#include "flexcomp/bytes.hpp"
#include "flexcomp/image.hpp"
#include "input_error.hpp"
#include "model/parameter_image.hpp"

namespace flexcomp::host {
namespace {

/// Requirements of an image, collected record by record.
struct Requirements {
  std::set<unsigned> bases;
  std::size_t variable_terms = 0;  ///< constant ones are folded into the nominal chain
  std::size_t tables = 0;
  std::size_t values = 0;

  Refusal table(const Table& t, const std::uint8_t*) {
    ++tables;
    values += t.size;
    return Refusal::none;
  }
  Refusal term(const Term<double>& t) {
    bases.insert(static_cast<unsigned>(t.basis));
    if (!is_constant(t)) ++variable_terms;
    return Refusal::none;
  }
};

std::string short_hex(const Sha256Digest& digest) { return hex(digest).substr(0, 12) + "…"; }

/// Lists the requirements of a well-formed image (schema, bases, capacities) that a controller does not meet,
/// one sentence without full stop each. The robot that the image is bound to is not compared.
std::vector<std::string> beyond_capability(const wire::Capability& capability,
                                           std::span<const std::uint8_t> image) {
  std::vector<std::string> out;
  ImageHeader header;
  Requirements required;
  Refusal refusal = read_header(image.data(), image.size(), header);
  if (refusal == Refusal::none) refusal = visit_image<double>(image.data(), image.size(), required);
  if (refusal != Refusal::none) return {text(refusal)};
  if (capability.schema >> 8U != header.schema_major) {
    out.push_back(fmt::format("the image has schema {}.{}, the controller knows {}.x", header.schema_major,
                              header.schema_minor, capability.schema >> 8U));
  } else if (header.schema_minor > (capability.schema & 0xFFU)) {
    out.push_back(fmt::format(
        "the image has schema {}.{}, the controller knows {}.{}: it can check neither unit nor "
        "signature",
        header.schema_major, header.schema_minor, capability.schema >> 8U, capability.schema & 0xFFU));
  }
  for (const unsigned basis : required.bases) {
    if (basis >= 32 || (capability.bases >> basis & 1U) == 0) {
      out.push_back(fmt::format("basis {} is not known to the controller", basis));
    }
  }
  const auto require = [&out](std::size_t needed, std::size_t there, const char* what) {
    if (needed > there)
      out.push_back(fmt::format("{} {} are needed, the controller holds {}", needed, what, there));
  };
  require(required.variable_terms, capability.terms, "terms that are not constant");
  require(required.tables, capability.tables, "tables");
  require(required.values, capability.values, "table values");
  require(image.size(), capability.image_bytes, "bytes");
  return out;
}

}  // namespace

std::uint32_t next_sequence(ControllerClient& client) {
  const wire::Status now = client.status();
  // Serial number arithmetic (RFC 1982); 0 means none.
  const bool previous_is_newer =
      now.previous_sequence != 0 && now.previous_sequence - now.active_sequence < 0x80000000U;
  const std::uint32_t next = (previous_is_newer ? now.previous_sequence : now.active_sequence) + 1;
  return next != 0 ? next : 1;
}

void refuse_beyond_capability(const ControllerClient& client, const std::string& source,
                              std::span<const std::uint8_t> image) {
  const std::vector<std::string> beyond = beyond_capability(client.capability(), image);
  if (beyond.empty()) return;
  throw BusError(client.where(), fmt::format("{} is more than this controller can do: {}; nothing was sent",
                                             source, fmt::join(beyond, "; ")));
}

void refuse_other_unit(const ControllerClient& client, const std::optional<ControllerUnit>& there,
                       const std::string& source, const Sha256Digest& unit_hash, const std::string& serial) {
  if (!is_given(unit_hash)) return;
  const std::string wanted = unit_text(serial, unit_hash);
  if (!there) {
    throw BusError(
        client.where(),
        fmt::format("{} is bound to {}, and this firmware cannot check which unit it belongs to: update it, "
                    "or take the serial number out of the robot file; nothing was sent",
                    source, wanted));
  }
  if (there->hash == unit_hash) return;
  throw BusError(client.where(), fmt::format("{} is for {}, the controller belongs to {}; nothing was sent",
                                             source, wanted, unit_text(there->serial, there->hash)));
}

SetIdentity identity(std::span<const std::uint8_t> image) {
  // include/flexcomp/image.hpp
  constexpr std::size_t sequence_at = 12;
  SetIdentity out;
  out.bytes = static_cast<std::uint32_t>(image.size());
  if (image.size() >= sequence_at + 4) {
    out.sequence = load_u32(image.data() + sequence_at);
    out.crc = load_u32(image.data() + image.size() - 4);
  }
  return out;
}

bool SetIdentity::is_active(const wire::Status& status) const {
  return status.active_slot != wire::no_slot && status.active_sequence == sequence &&
         status.active_crc == crc && status.active_bytes == bytes;
}

std::optional<wire::Status> read_back(ControllerClient& client, std::span<const std::uint8_t> image,
                                      const Progress& progress) {
  const SetIdentity wanted = identity(image);
  std::string trouble = "its active set was to be read back";
  for (int attempt = 0; attempt < 5; ++attempt) {
    const wire::Status before = client.settled_status(trouble);
    if (!wanted.is_active(before)) return std::nullopt;
    try {
      const Bytes back = client.active_image(progress);
      const auto [there, sent] = std::mismatch(back.begin(), back.end(), image.begin(), image.end());
      if (there == back.end() && sent == image.end()) return before;
      trouble = back.size() != image.size()
                    ? fmt::format("the active set has {} bytes, {} were sent", back.size(), image.size())
                    : fmt::format("byte {} of the active set is 0x{:02X}, 0x{:02X} was sent",
                                  there - back.begin(), *there, *sent);
    } catch (const BusError& e) {
      trouble = e.text();
    }
  }
  throw OutcomeOpen(client.where(),
                    fmt::format("set {} is active by its number, CRC and length, but was not read back: {}",
                                wanted.sequence, trouble));
}

void stage_verified(ControllerClient& client, std::span<const std::uint8_t> bytes, const Progress& progress) {
  try {
    client.stage(bytes, progress);
    client.run(wire::Command::verify);
  } catch (const RefusedByController& e) {
    // In a busy controller the staging area belongs to another client.
    if (e.answer() != wire::Answer::busy) {
      try {
        client.run(wire::Command::abort);
      } catch (const BusError&) {
        // The first error is reported; the controller drops a stale staging area by its own time limit.
      }
    }
    throw;
  }
}

wire::Status push_image(ControllerClient& client, std::span<const std::uint8_t> image,
                        const PushOptions& options) {
  stage_verified(client, image, options.progress);
  const SetIdentity wanted = identity(image);
  client.conclude(options.trial_cycles ? wire::Command::commit_trial : wire::Command::commit,
                  options.trial_cycles.value_or(0),
                  [&wanted](const wire::Status& now) { return wanted.is_active(now); });
  if (const auto active = read_back(client, image, options.progress)) return *active;
  const wire::Status now = client.settled_status("its active set was to be read back");
  throw RefusedByController(
      client.where(),
      fmt::format("set {} was active, but is no longer: {}", wanted.sequence,
                  now.answer == static_cast<std::uint16_t>(wire::Answer::reverted)
                      ? text(wire::Answer::reverted)
                  : now.active_slot == wire::no_slot ? "no set is active now"
                                                     : fmt::format("set {} is", now.active_sequence)),
      static_cast<wire::Answer>(now.answer), static_cast<Refusal>(now.refusal));
}

wire::Status confirm_trial(ControllerClient& client) {
  const wire::Status before = client.status();
  return client.conclude(wire::Command::confirm, 0, [&before](const wire::Status& now) {
    constexpr auto trial = static_cast<std::uint16_t>(wire::StoreState::trial);
    return before.state == trial && now.state != trial && now.active_slot == before.active_slot &&
           now.active_sequence == before.active_sequence && now.active_crc == before.active_crc;
  });
}

wire::Status roll_back(ControllerClient& client) {
  const wire::Status before = client.status();
  return client.conclude(wire::Command::rollback, 0, [&before](const wire::Status& now) {
    return now.active_slot != before.active_slot || now.active_sequence != before.active_sequence ||
           now.active_crc != before.active_crc;
  });
}

wire::Status erase(ControllerClient& client) {
  const auto is_empty = [](const wire::Status& now) {
    return now.active_slot == wire::no_slot && now.previous_sequence == 0;
  };
  // Where there was nothing before, the answer alone tells whether it was done.
  const bool was_empty = is_empty(client.status());
  return client.conclude(wire::Command::restore_defaults, 0, [&](const wire::Status& now) {
    return is_empty(now) && (!was_empty || now.answer == static_cast<std::uint16_t>(wire::Answer::accepted));
  });
}

void unlock(ControllerClient& client) {
  // The number is told in a status that is every client's: another one's command may have changed it meanwhile.
  for (int attempt = 0;; ++attempt) {
    client.run(wire::Command::unlock);
    const std::uint32_t number = client.status().detail;
    try {
      client.run(wire::Command::unlock, number);
      return;
    } catch (const RefusedByController& e) {
      if (attempt == 2 || e.answer() != wire::Answer::not_authorised) throw;
    }
  }
}

Robot robot_of(ControllerClient& client, const std::string& robot_path) {
  if (robot_path.empty()) {
    std::optional<Robot> told = client.robot();
    if (!told) {
      throw BusError(client.where(), "this controller does not tell which robot it is for",
                     ErrorCode::unknown_robot);
    }
    return *std::move(told);
  }
  Robot robot = load_robot(robot_path);
  const wire::Capability& there = client.capability();
  if (robot.nominal.name_hash != there.name_hash) {
    throw BusError(client.where(),
                   fmt::format("the controller is for another robot than '{}' ({})", robot.name, robot.path));
  }
  if (nominal_hash(robot.nominal) != there.nominal_hash) {
    throw BusError(client.where(), fmt::format("the controller's nominal geometry is {}, that of {} is {}",
                                               short_hex(there.nominal_hash), robot.path,
                                               short_hex(nominal_hash(robot.nominal))));
  }
  if (is_given(robot.nominal.unit_hash)) {
    const std::optional<ControllerUnit> unit = client.unit();
    if (unit && is_given(unit->hash) && unit->hash != robot.nominal.unit_hash)
      throw BusError(client.where(), fmt::format("{} is {}, the controller belongs to {}", robot.path,
                                                 unit_text(robot.serial, robot.nominal.unit_hash),
                                                 unit_text(unit->serial, unit->hash)));
  }
  return robot;
}

Calibration load_calibration_for(ControllerClient& client, const std::string& path, const Robot& robot) {
  const wire::Capability& there = client.capability();
  const YamlField root = YamlField::load(path);
  Robot known = robot;
  if (const auto field = root.find("robot")) {
    const std::string name = field->text();
    if (name_hash(name.data(), name.size()) != there.name_hash) {
      throw BusError(client.where(),
                     fmt::format("{} is for another robot ('{}') than the controller{}; nothing was sent",
                                 path, name, robot.name.empty() ? "" : fmt::format(" ('{}')", robot.name)));
    }
    known.name = name;
  }
  if (const auto field = root.find("nominal_hash")) {
    const std::string hash = field->text();
    if (hash.size() == 64 && hash != hex(there.nominal_hash)) {
      throw BusError(
          client.where(),
          fmt::format("{} is for another nominal geometry ({}…) than the controller's ({}); nothing was "
                      "sent",
                      path, hash.substr(0, 12), short_hex(there.nominal_hash)));
    }
  }
  return load_calibration(path, known);
}

Bytes pull_image(ControllerClient& client, const Progress& progress) {
  Bytes image = client.active_image(progress);
  if (image.empty()) {
    throw BusError(client.where(), "the controller has no active set, it passes commands through");
  }
  const wire::Capability& there = client.capability();
  ImageHeader header;
  const Refusal refusal =
      check_image(image.data(), image.size(), there.nominal_hash, there.name_hash, header);
  if (refusal != Refusal::none) {
    throw BusError(client.where(), fmt::format("what was read is not the active set: {}", text(refusal)));
  }
  return image;
}

Calibration calibration_held(const ControllerClient& client, std::span<const std::uint8_t> image,
                             const Robot& robot) {
  try {
    return calibration_from_image(image, robot, client.where());
  } catch (const InputError& e) {
    // The bytes came from the controller: it is no file of the user's that is refused.
    throw BusError(client.where(), InputError("", e.line(), e.field(), e.expected(), e.found()).what());
  }
}

std::optional<Bytes> read_image_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    throw InputError(path, 0, "", "a calibration file or a parameter image",
                     std::generic_category().message(errno));
  }
  Bytes bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  constexpr std::string_view magic = "FLXC";
  if (bytes.size() < magic.size() || !std::equal(magic.begin(), magic.end(), bytes.begin()))
    return std::nullopt;
  return bytes;
}

}  // namespace flexcomp::host
