// SPDX-License-Identifier: Apache-2.0
/// \file
/// Who is on a CAN bus, by what nodes send without being asked: heartbeats and boot-up messages (CiA 301, 7.2.8.3.2), EMCY.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>

#include "bus/descriptor.hpp"

namespace flexcomp::host {

/// Listens from its construction on: the kernel keeps the frames, which are read only when somebody asks.
class Heartbeats {
 public:
  Heartbeats() = default;  ///< hears nothing and says nothing
  /// \param socket  one struct can_frame per read
  explicit Heartbeats(Descriptor socket);

  /// What is known about `node` and of others, as the end of a message: "; node 5 is stopped", "; heard here: 3, 7",
  /// "; nothing was heard". Where `node` has not been heard, listens until `at_least` after the construction.
  std::string about(std::uint8_t node, std::chrono::milliseconds at_least);

 private:
  struct Node {
    int state = -1;      ///< as in the last heartbeat; -1: none
    int before = -1;     ///< the one before that was another
    unsigned turns = 0;  ///< back to the state before, without a boot-up message between
  };
  bool take(std::chrono::steady_clock::time_point end);

  Descriptor socket_;
  std::chrono::steady_clock::time_point start_{};
  std::map<unsigned, Node> nodes_;
};

}  // namespace flexcomp::host
