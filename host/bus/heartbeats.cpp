// SPDX-License-Identifier: Apache-2.0
#include "bus/heartbeats.hpp"

#include <fmt/format.h>
#include <linux/can.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "flexcomp/wire/canopen_objects.hpp"

namespace flexcomp::host {
namespace {

namespace co = wire::canopen;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr unsigned node_bits = 0x7F;

/// Heartbeats that go to and fro between two states so many times are of two nodes: a master that commands it has a reason
/// for the first, and nobody for the third.
constexpr unsigned turns_of_two = 3;

std::string state_name(int state) {
  switch (static_cast<co::NmtState>(state)) {
    case co::NmtState::initialising:
      return "starting";
    case co::NmtState::stopped:
      return "stopped";
    case co::NmtState::operational:
      return "operational";
    case co::NmtState::pre_operational:
      return "pre-operational";
  }
  return fmt::format("in state {}, which CiA 301 does not know", state);
}

}  // namespace

Heartbeats::Heartbeats(Descriptor socket) : socket_(std::move(socket)), start_(steady_clock::now()) {}

/// Takes in one frame; false where none has come until `end`.
bool Heartbeats::take(steady_clock::time_point end) {
  const auto left = std::chrono::ceil<milliseconds>(end - steady_clock::now()).count();
  pollfd ready{socket_.get(), POLLIN, 0};
  if (::poll(&ready, 1, static_cast<int>(std::max<long>(left, 0))) <= 0) return false;
  can_frame frame{};
  if (::recv(socket_.get(), &frame, sizeof frame, MSG_DONTWAIT) != sizeof frame) return false;
  const unsigned function = frame.can_id & ~node_bits;
  const unsigned number = frame.can_id & node_bits;
  if (number == 0 || (function != co::heartbeat_id && function != co::emergency_id)) return true;
  if (function == co::heartbeat_id && frame.can_dlc != 1) return true;
  Node& node = nodes_[number];
  if (function == co::emergency_id) return true;
  const int state = frame.data[0] & node_bits;  // bit 7 is the toggle bit of node guarding
  if (state == node.state) return true;
  if (state == 0 || node.state == 0) {
    node.turns = 0;
  } else if (state == node.before) {
    ++node.turns;
  }
  node.before = node.state;
  node.state = state;
  return true;
}

std::string Heartbeats::about(std::uint8_t node, milliseconds at_least) {
  if (!socket_) return {};
  // What has come until now, however much, then what comes.
  for (int k = 0; k < 10000 && take(steady_clock::now()); ++k) {
  }
  while (nodes_.count(node) == 0 && take(start_ + at_least)) {
  }
  const auto found = nodes_.find(node);
  if (found != nodes_.end()) {
    const Node& it = found->second;
    if (it.turns >= turns_of_two) {
      return fmt::format("; two nodes have the number {}: its heartbeats say {} and {} by turns", node,
                         state_name(it.state), state_name(it.before));
    }
    return it.state < 0 ? fmt::format("; node {} sends EMCY", node)
                        : fmt::format("; node {} is {}", node, state_name(it.state));
  }
  std::vector<unsigned> others;
  for (const auto& other : nodes_) others.push_back(other.first);
  return others.empty() ? "; nothing was heard" : fmt::format("; heard here: {}", fmt::join(others, ", "));
}

}  // namespace flexcomp::host
