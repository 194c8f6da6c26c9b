// SPDX-License-Identifier: Apache-2.0
/// \file
/// A controller that does what a test tells it to: just enough of the parameter store to answer the clients.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "bus/controller_client.hpp"
#include "flexcomp/bytes.hpp"
#include "flexcomp/robot.hpp"
#include "flexcomp/wire/robot_record.hpp"
#include "flexcomp/wire/store_state.hpp"
#include "flexcomp/wire/unit_record.hpp"
#include "model/parameter_image.hpp"
#include "signing/signed_bytes.hpp"

namespace flexcomp::fake {

using Bytes = std::vector<std::uint8_t>;

struct Controller {
  wire::Capability capability;
  wire::Status status;
  NominalRobot<6> robot;
  std::string name = "fake";
  bool tells_robot = true;
  Bytes staged;
  Bytes active;
  Bytes previous;

  // Who may: only where has_unit().
  wire::UnitRecord unit;
  std::vector<host::PublicKey> trusted;
  std::uint32_t unlock_number = 0;
  bool unlocked = false;
  wire::Command permitted = wire::Command::none;  ///< by a signed command
  int numbers_overtaken = 0;                      ///< so many unlock numbers are gone before they are read
  std::vector<wire::Command> commands;            ///< that were given

  // What goes wrong.
  Refusal verify_refuses = Refusal::none;
  wire::Answer commit_ends = wire::Answer::accepted;
  int busy = 0;           ///< so many commands are answered busy
  int commits_lost = 0;   ///< so many commits do nothing
  int working_polls = 0;  ///< so many status records say that memory is being written
  std::function<void()> on_commit;
  bool damages_image = false;
  bool overtaken = false;  ///< another client's command is answered before ours is looked at

  Controller() {
    robot.links[1].a_m = 0.4;
    capability.joints = 6;
    capability.scalar_bytes = 8;
    capability.schema = 0x0100;
    capability.bases = 0x3FFFF;
    capability.terms = 64;
    capability.tables = 8;
    capability.values = 768;
    capability.image_bytes = 12288;
    capability.cycle_us = 1000;
    capability.nominal_hash = nominal_hash(robot);
    capability.name_hash = name_hash(name.data(), name.size());
  }

  /// The unit record is told from here on, and what it says is kept.
  void belongs_to(const std::string& serial, const std::vector<host::PublicKey>& keys = {}) {
    capability.flags = wire::capability_flag::unit;
    capability.schema = 0x0101;
    unit = {};
    unit.unit_hash = name_hash(serial.data(), serial.size());
    unit.serial_size = static_cast<std::uint16_t>(serial.size());
    std::copy(serial.begin(), serial.end(), unit.serial.begin());
    trusted = keys;
    unit.keys = static_cast<std::uint16_t>(keys.size());
    for (std::size_t k = 0; k < std::min<std::size_t>(keys.size(), 4); ++k)
      unit.key_ids[k] = host::id_of(keys[k]);
  }
  bool tells_flags() const { return (capability.flags & wire::capability_flag::probe_flags) != 0; }
  bool has_unit() const { return (capability.flags & wire::capability_flag::unit) != 0; }

  /// Whether what is staged is for this unit and from whom it trusts.
  Refusal check() {
    if (!has_unit()) return Refusal::none;
    SignedCommand command;
    host::ImageRecords set;
    const bool is_command = looks_like_command(staged.data(), staged.size());
    if (is_command) {
      const Refusal r = decode(staged.data(), staged.size(), command);
      if (r != Refusal::none) return r;
      set = {command.unit_hash, true, command.counter, command.key_id};
    } else {
      set = host::image_records(staged, "staged");
    }
    if (is_given(set.unit_hash) && set.unit_hash != unit.unit_hash) return Refusal::wrong_unit;
    if (trusted.empty()) return Refusal::none;
    if (!set.is_signed || !is_given(set.unit_hash)) return Refusal::not_signed;
    const auto key = std::find_if(trusted.begin(), trusted.end(),
                                  [&](const host::PublicKey& k) { return host::id_of(k) == set.key_id; });
    if (key == trusted.end()) return Refusal::unknown_key;
    if (!(is_command ? host::is_command_signed_by(staged, *key) : host::is_signed_by(staged, *key)))
      return Refusal::wrong_signature;
    if (set.counter <= unit.counter) return Refusal::counter_used;
    unit.counter = set.counter;
    if (is_command && command.active_crc == status.active_crc)
      permitted = static_cast<wire::Command>(command.command);
    return Refusal::none;
  }

  bool may_destroy(wire::Command command) {
    const bool out = !has_unit() || (trusted.empty() ? unlocked : permitted == command);
    unlocked = false;
    permitted = wire::Command::none;
    return out;
  }

  wire::Answer refuse_to_destroy() {
    return answer(wire::Answer::not_authorised, Refusal::none,
                  trusted.empty() ? wire::needs_unlock : wire::needs_signature);
  }

  void activate(const Bytes& image) {
    active = image;
    status.active_slot = image.empty() ? wire::no_slot : std::uint16_t{0};
    status.active_bytes = static_cast<std::uint32_t>(active.size());
    status.active_sequence = image.empty() ? 0 : load_u32(active.data() + 12);
    status.active_crc = image.empty() ? 0 : load_u32(active.data() + active.size() - 4);
    status.previous_sequence = previous.empty() ? 0 : load_u32(previous.data() + 12);
    status.state = static_cast<std::uint16_t>(wire::StoreState::idle);
  }

  wire::Answer answer(wire::Answer a, Refusal r = Refusal::none, std::uint32_t detail = 0) {
    status.answer = static_cast<std::uint16_t>(a);
    status.refusal = static_cast<std::uint16_t>(r);
    status.detail = detail;
    return a;
  }

  wire::Answer run(wire::Command command, std::uint32_t argument) {
    using wire::Answer;
    if (busy > 0) {
      --busy;
      return answer(Answer::busy);
    }
    commands.push_back(command);
    switch (command) {
      case wire::Command::begin:
        staged.assign(argument, 0);
        status.state = static_cast<std::uint16_t>(wire::StoreState::receiving);
        return answer(Answer::accepted);
      case wire::Command::verify:
        if (verify_refuses != Refusal::none) return answer(Answer::refused, verify_refuses, 23);
        if (const Refusal r = check(); r != Refusal::none) return answer(Answer::refused, r);
        status.state = static_cast<std::uint16_t>(wire::StoreState::verified);
        return answer(Answer::accepted);
      case wire::Command::commit:
        if (on_commit) on_commit();
        if (commits_lost > 0) {
          --commits_lost;
          return answer(Answer::accepted);
        }
        if (commit_ends == Answer::accepted) {
          previous = active;
          activate(staged);
          if (damages_image) active[active.size() / 2] ^= 1U;
        }
        status.state = static_cast<std::uint16_t>(wire::StoreState::idle);
        answer(overtaken ? Answer::busy : commit_ends);
        return Answer::accepted;
      case wire::Command::abort:
        staged.clear();
        status.state = static_cast<std::uint16_t>(wire::StoreState::idle);
        return Answer::accepted;
      case wire::Command::rollback:
        if (previous.empty()) return answer(Answer::no_previous);
        if (status.state != static_cast<std::uint16_t>(wire::StoreState::trial) && !may_destroy(command))
          return refuse_to_destroy();
        staged = std::exchange(previous, {});
        activate(staged);
        return answer(Answer::accepted);
      case wire::Command::restore_defaults:
        if (!may_destroy(command)) return refuse_to_destroy();
        previous.clear();
        activate({});
        return answer(Answer::accepted);
      case wire::Command::unlock:
        if (!has_unit()) return answer(Answer::unknown_command);
        if (argument == 0) {
          unlock_number += 0x1234567;
          answer(Answer::accepted, Refusal::none, unlock_number);
          if (numbers_overtaken > 0) {
            --numbers_overtaken;
            answer(Answer::wrong_state, Refusal::none, 7);
          }
          return Answer::accepted;
        }
        unlocked = argument == unlock_number;
        return answer(unlocked ? Answer::accepted : Answer::not_authorised);
      default:
        return answer(Answer::unknown_command);
    }
  }

  wire::Status now() {
    wire::Status out = status;
    if (working_polls > 0) {
      --working_polls;
      out.state = static_cast<std::uint16_t>(wire::StoreState::working);
    }
    return out;
  }

  /// Recognisable: half of each joint, and bits that only a binary64 has.
  wire::ProbeResponse probe(const wire::ProbeRequest& request) const {
    wire::ProbeResponse out;
    for (std::size_t j = 0; j < 6; ++j) out.q_rad[j] = bits_of(double_of(request.q_rad[j]) / 2);
    out.position_m = request.payload_kg;
    out.orientation_rad = request.relative_speed[5];
    out.status = 1;
    out.flags = step_flag::near_singular | step_flag::not_converged;
    out.sequence = status.active_sequence;
    return out;
  }

  Bytes capability_record(wire::ByteOrder order) const {
    Bytes out(wire::capability_bytes);
    wire::encode(capability, order, out.data());
    return out;
  }
  Bytes status_record(wire::ByteOrder order) {
    Bytes out(wire::status_bytes);
    wire::encode(now(), order, out.data());
    return out;
  }
  Bytes unit_record(wire::ByteOrder order) const {
    Bytes out(wire::unit_record_bytes);
    wire::encode(unit, order, out.data());
    return out;
  }
  Bytes robot_record(wire::ByteOrder order) const {
    Bytes out(wire::robot_record_bytes);
    wire::encode(robot, name.data(), name.size(), order, out.data());
    return out;
  }
};

inline Bytes numbered_bytes(std::size_t size) {
  Bytes out(size);
  for (std::size_t k = 0; k < size; ++k) out[k] = static_cast<std::uint8_t>(k * 37U + (k >> 8U));
  return out;
}

/// The same with number and CRC where an image has them.
inline Bytes numbered_image(std::size_t size, std::uint32_t sequence = 1) {
  Bytes out = numbered_bytes(size);
  store_u32(out.data() + 12, sequence);
  return out;
}

inline host::ClientOptions quick() {
  return {.response_timeout = std::chrono::milliseconds(600),
          .write_timeout = std::chrono::milliseconds(500),
          .staging_timeout = std::chrono::milliseconds(600)};
}

/// A probe of the controller above comes back with every bit, its flags where the controller tells them, else that of the status.
inline void expect_exact_probe(host::ControllerClient& client, bool tells_flags = false) {
  wire::ProbeRequest request;
  for (std::size_t j = 0; j < 6; ++j) request.q_rad[j] = bits_of(0.1 * static_cast<double>(j) + 1e-17);
  request.payload_kg = bits_of(1.0 / 3);
  request.relative_speed[5] = bits_of(-0.7);
  const wire::ProbeResponse response = client.probe(request);
  EXPECT_EQ(response.q_rad[3], bits_of((0.1 * 3 + 1e-17) / 2));
  EXPECT_EQ(response.position_m, bits_of(1.0 / 3));
  EXPECT_EQ(response.orientation_rad, bits_of(-0.7));
  EXPECT_EQ(response.status, 1);
  EXPECT_EQ(response.flags,
            tells_flags ? step_flag::near_singular | step_flag::not_converged : step_flag::near_singular);
}

}  // namespace flexcomp::fake
