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
#include <vector>

#include "bus/controller_client.hpp"
#include "flexcomp/bytes.hpp"
#include "flexcomp/robot.hpp"
#include "flexcomp/wire/robot_record.hpp"
#include "flexcomp/wire/store_state.hpp"

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
    switch (command) {
      case wire::Command::begin:
        staged.assign(argument, 0);
        status.state = static_cast<std::uint16_t>(wire::StoreState::receiving);
        return answer(Answer::accepted);
      case wire::Command::verify:
        if (verify_refuses != Refusal::none) return answer(Answer::refused, verify_refuses, 23);
        status.state = static_cast<std::uint16_t>(wire::StoreState::verified);
        return answer(Answer::accepted);
      case wire::Command::commit:
        if (on_commit) on_commit();
        if (commits_lost > 0) {
          --commits_lost;
          return answer(Answer::accepted);
        }
        if (commit_ends == Answer::accepted) {
          active = staged;
          if (damages_image) active[active.size() / 2] ^= 1U;
          status.active_slot = 0;
          status.active_bytes = static_cast<std::uint32_t>(active.size());
          status.active_sequence = load_u32(active.data() + 12);
          status.active_crc = load_u32(active.data() + active.size() - 4);
        }
        status.state = static_cast<std::uint16_t>(wire::StoreState::idle);
        answer(overtaken ? Answer::busy : commit_ends);
        return Answer::accepted;
      case wire::Command::abort:
        staged.clear();
        status.state = static_cast<std::uint16_t>(wire::StoreState::idle);
        return Answer::accepted;
      case wire::Command::rollback:
        return answer(Answer::no_previous);
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
          .write_timeout = std::chrono::milliseconds(500)};
}

/// A probe of the controller above comes back with every bit.
inline void expect_exact_probe(host::ControllerClient& client) {
  wire::ProbeRequest request;
  for (std::size_t j = 0; j < 6; ++j) request.q_rad[j] = bits_of(0.1 * static_cast<double>(j) + 1e-17);
  request.payload_kg = bits_of(1.0 / 3);
  request.relative_speed[5] = bits_of(-0.7);
  const wire::ProbeResponse response = client.probe(request);
  EXPECT_EQ(response.q_rad[3], bits_of((0.1 * 3 + 1e-17) / 2));
  EXPECT_EQ(response.position_m, bits_of(1.0 / 3));
  EXPECT_EQ(response.orientation_rad, bits_of(-0.7));
  EXPECT_EQ(response.status, 1);
}

}  // namespace flexcomp::fake
