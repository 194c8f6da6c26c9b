// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <thread>
#include <utility>

#include "bus/controller_client.hpp"
#include "bus/descriptor.hpp"
#include "bus/sdo_client.hpp"
#include "flexcomp/bytes.hpp"
#include "flexcomp/wire/canopen_objects.hpp"
#include "flexcomp/wire/robot_record.hpp"
#include "flexcomp/wire/unit_record.hpp"

namespace flexcomp::host {
namespace {

namespace co = wire::canopen;
using std::chrono::milliseconds;
using std::chrono::steady_clock;
using namespace std::chrono_literals;

std::string reason(int error) { return std::generic_category().message(error); }

Descriptor open_can(const std::string& interface, unsigned node, const std::string& where) {
  Descriptor out(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW));
  if (out.get() < 0) {
    throw BusError(where, fmt::format("this system gives no CAN sockets: {}", reason(errno)),
                   ErrorCode::no_can_sockets);
  }
  const unsigned index = if_nametoindex(interface.c_str());
  if (index == 0)
    throw BusError(where, fmt::format("there is no interface '{}'", interface), ErrorCode::bus_not_opened);
  // Extended, remote and other nodes' frames stay in the kernel.
  const can_filter answers{co::sdo_answer_id + node, CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG};
  sockaddr_can to{};
  to.can_family = AF_CAN;
  to.can_ifindex = static_cast<int>(index);
  if (::setsockopt(out.get(), SOL_CAN_RAW, CAN_RAW_FILTER, &answers, sizeof answers) != 0 ||
      ::bind(out.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) {
    throw BusError(where, fmt::format("the interface '{}' cannot be used: {}", interface, reason(errno)),
                   ErrorCode::bus_not_opened);
  }
  return out;
}

/// Locks the SDO channel against other programs of this machine: with two clients each would receive the
/// other's answers. The lock is an abstract socket name, unique in the network namespace, which the kernel
/// frees when the process ends.
Descriptor lock_channel(const CanAddress& can, const ClientOptions& options, const std::string& where) {
  Descriptor out(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (out.get() < 0) throw BusError(where, fmt::format("no local socket: {}", reason(errno)));
  const std::string name = fmt::format("flexcomp-sdo-{}-{}", can.interface, can.node);
  sockaddr_un at{};
  at.sun_family = AF_UNIX;
  // The first byte stays 0: an abstract name, without a file.
  std::copy(name.begin(), name.end(), at.sun_path + 1);
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  const auto end = steady_clock::now() + options.response_timeout;
  while (::bind(out.get(), reinterpret_cast<const sockaddr*>(&at), size) != 0) {
    if (errno != EADDRINUSE) throw BusError(where, fmt::format("{}", reason(errno)));
    if (steady_clock::now() > end) {
      throw BusError(where,
                     fmt::format("another program on this machine has been talking to node {} for {:.1f} s",
                                 can.node, in_seconds(options.response_timeout)));
    }
    std::this_thread::sleep_for(milliseconds(20));
  }
  return out;
}

class CanopenClient final : public ControllerClient {
 public:
  CanopenClient(const BusAddress& address, const ClientOptions& options, Descriptor channel,
                Descriptor socket)
      : ControllerClient(address, options),
        node_(std::get<CanAddress>(address.at).node),
        timeout_(options.response_timeout),
        channel_(std::move(channel)),
        socket_(std::move(socket)),
        sdo_(socket_.get(), node_, timeout_) {
    read_capability();
  }

 protected:
  wire::ByteOrder byte_order() const override { return wire::ByteOrder::little; }

  Bytes read_record(Record record, std::size_t size) override {
    ObjectAddress object{co::capability, 0};
    if (record == Record::status) object.index = co::status;
    if (record == Record::robot) object.index = co::robot;
    if (record == Record::unit) object.index = co::unit;
    return upload(object, size);
  }

  void send_image(std::span<const std::uint8_t> image, const Progress& progress) override {
    // A transfer that was broken off leaves nothing at the server: it may be begun anew.
    download({co::image, co::image_staging}, image, progress);
  }

  void send_command(wire::Command command, std::uint32_t argument) override {
    std::array<std::uint8_t, 4> bytes{};
    if (argument != 0 || last_argument_ != 0) {
      store_u32(bytes.data(), argument);
      download({co::command, co::command_argument}, bytes);
      last_argument_ = argument;
    }
    store_u16(bytes.data(), static_cast<std::uint16_t>(command));
    // Sent once: a command whose answer got lost may have been executed.
    const ObjectAddress object{co::command, co::command_number};
    repeat("to write", object, 0ms, [&] { sdo_.download_once(object, std::span(bytes).first(2)); });
  }

  Bytes read_image(std::size_t size, const Progress& progress) override {
    return upload({co::image, co::image_active}, size, progress);
  }

  Bytes exchange_probe(std::span<const std::uint8_t> request) override {
    download({co::probe, co::probe_request}, request);
    return upload({co::probe, co::probe_response}, wire::probe_response_bytes);
  }

 private:
  /// A transfer that is disturbed again and again is given up after so many response times.
  static constexpr int disturbed_response_times = 10;

  Bytes upload(ObjectAddress object, std::size_t size, const Progress& progress = {}) {
    Bytes out;
    repeat("to read", object, disturbed_response_times * timeout_,
           [&] { out = sdo_.upload(object, progress, size); });
    if (out.size() != size) {
      throw BusError(where(), fmt::format("object {} of node {} has {} bytes, expected {}", object.text(),
                                          node_, out.size(), size));
    }
    return out;
  }

  void download(ObjectAddress object, std::span<const std::uint8_t> data, const Progress& progress = {}) {
    repeat("to write", object, disturbed_response_times * timeout_,
           [&] { sdo_.download(object, data, progress); });
  }

  /// What was on the channel besides since `before`, for a message.
  std::string besides(const SdoDisturbances& before) const {
    SdoDisturbances now = sdo_.disturbances();
    now.lost -= before.lost;
    now.doubled -= before.doubled;
    now.foreign -= before.foreign;
    if (!now.any()) return {};
    return fmt::format("; seen meanwhile: {}{}", now.text(),
                       now.foreign != 0 ? " (another master uses this node's SDO channel)" : "");
  }

  /// Begins a transfer anew until it gets through, for at most this long.
  template <class Transfer>
  void repeat(const char* what, ObjectAddress object, milliseconds longest, const Transfer& transfer) {
    const SdoDisturbances before = sdo_.disturbances();
    const auto start = steady_clock::now();
    milliseconds pause{2};
    for (int attempt = 1;; ++attempt) {
      try {
        transfer();
        return;
      } catch (const SdoAbort& e) {
        // A lost or doubled frame, or another client's transfer, ends in one of these codes.
        const bool disturbed = !e.by_server() || e.code() == co::abort::toggle ||
                               e.code() == co::abort::timeout || e.code() == co::abort::command ||
                               e.code() == co::abort::sequence || e.code() == co::abort::crc;
        if (!disturbed)
          throw BusRefusal{e.code() == co::abort::busy, e.code() == co::abort::no_object, e.what()};
        if (steady_clock::now() - start >= longest) {
          throw BusError(where(),
                         fmt::format("node {}: asked {} object {}, the transfer was broken off {} "
                                     "within {:.1f} s, at last by {}{}",
                                     node_, what, object.text(),
                                     attempt == 1 ? "once" : fmt::format("{} times", attempt),
                                     std::chrono::duration<double>(steady_clock::now() - start).count(),
                                     e.what(), besides(before)));
        }
      } catch (const SdoTimeout&) {
        throw NoAnswer(where(), fmt::format("node {} did not answer for {:.2f} s when asked {} object {}{}",
                                            node_, in_seconds(longest == 0ms ? timeout_ / 4 : timeout_), what,
                                            object.text(), besides(before)));
      } catch (const std::system_error& e) {
        throw BusError(where(), fmt::format("{}", e.what()));
      }
      sdo_.await_silence();
      // Not in step with a master that asks at a fixed rate.
      std::this_thread::sleep_for(pause);
      pause = std::min(2 * pause, milliseconds(67));
    }
  }

  std::uint8_t node_;
  milliseconds timeout_;
  Descriptor channel_;
  Descriptor socket_;
  SdoClient sdo_;
  std::uint32_t last_argument_ = 1;  ///< another client's may still be there
};

}  // namespace

std::unique_ptr<ControllerClient> connect_canopen(const BusAddress& address, const ClientOptions& options) {
  const auto& can = std::get<CanAddress>(address.at);
  Descriptor socket = open_can(can.interface, can.node, address.text());
  Descriptor channel = lock_channel(can, options, address.text());
  return std::make_unique<CanopenClient>(address, options, std::move(channel), std::move(socket));
}

std::unique_ptr<ControllerClient> connect_canopen(const BusAddress& address, const ClientOptions& options,
                                                  int socket) {
  return std::make_unique<CanopenClient>(address, options, Descriptor(), Descriptor(socket));
}

}  // namespace flexcomp::host
