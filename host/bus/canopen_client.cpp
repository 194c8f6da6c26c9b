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
#include "bus/heartbeats.hpp"
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

/// A CAN socket that receives data frames with 11 bits and identifiers that these filters let through; others stay in the
/// kernel.
Descriptor open_can(const std::string& interface, std::vector<can_filter> filters, const std::string& where) {
  Descriptor out(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW));
  if (out.get() < 0) {
    throw BusError(where, fmt::format("this system gives no CAN sockets: {}", reason(errno)),
                   ErrorCode::no_can_sockets);
  }
  const unsigned index = if_nametoindex(interface.c_str());
  if (index == 0)
    throw BusError(where, fmt::format("there is no interface '{}'", interface), ErrorCode::bus_not_opened);
  for (can_filter& filter : filters) filter.can_mask |= CAN_EFF_FLAG | CAN_RTR_FLAG;
  sockaddr_can to{};
  to.can_family = AF_CAN;
  to.can_ifindex = static_cast<int>(index);
  if (::setsockopt(out.get(), SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(),
                   static_cast<socklen_t>(filters.size() * sizeof filters[0])) != 0 ||
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
  const std::string name = fmt::format("flexcomp-sdo-{}-{:X}", can.interface, can.sdo_request());
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
                Descriptor socket, Heartbeats heartbeats)
      : ControllerClient(address, options),
        at_(std::get<CanAddress>(address.at)),
        node_(at_.node),
        timeout_(options.response_timeout),
        channel_(std::move(channel)),
        socket_(std::move(socket)),
        heartbeats_(std::move(heartbeats)),
        sdo_(socket_.get(), at_.sdo_request(), at_.sdo_answer(), timeout_) {
    read_capability();
    throw_where_two({});
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

  Bytes exchange_probe(std::span<const std::uint8_t> request, bool with_flags) override {
    download({co::probe, co::probe_request}, request);
    Bytes out = upload({co::probe, co::probe_response}, wire::probe_response_bytes);
    if (with_flags) {
      const Bytes flags = upload({co::probe, co::probe_flags}, 2);
      out.insert(out.end(), flags.begin(), flags.end());
    }
    return out;
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

  /// Silence of less than this says nothing about nodes whose heartbeat time is one second.
  static constexpr milliseconds heartbeats_within{1500};

  /// Throws where two nodes have this number: one request is answered twice, and not with the same. Asks only where answers
  /// have come twice since `before`; the same answer twice may be a gateway's.
  void throw_where_two(const SdoDisturbances& before) {
    if (sdo_.disturbances().doubled == before.doubled) return;
    struct Question {
      ObjectAddress object;
      const char* text;
    };
    constexpr std::array<Question, 3> questions{{{{co::identity, 4}, "serial number"},
                                                 {{co::identity, 3}, "firmware revision"},
                                                 {{co::status_summary, 5}, "sequence of the active set"}}};
    for (const Question& question : questions) {
      const auto answers = sdo_.upload_from_all(question.object);
      if (answers.size() < 2) return;
      for (const auto& answer : answers) {
        if (answer == answers[0]) continue;
        throw BusError(
            where(), fmt::format("two nodes have the number {}: each request is answered twice, with {} "
                                 "0x{:X} and 0x{:X}",
                                 node_, question.text, load_u32(answers[0].data()), load_u32(answer.data())));
      }
    }
  }

  /// Why node_ may be silent, for a message.
  std::string silence() {
    const std::string heard = heartbeats_.about(node_, heartbeats_within);
    const bool is_there = heard.find(fmt::format("; node {}", node_)) == 0;
    return is_there && at_.own_request != 0
               ? fmt::format("{}, but may have no SDO server 1201h at {:X}h", heard, at_.own_request)
               : heard;
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
        if (attempt == 2) throw_where_two(before);
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
        throw NoAnswer(where(), fmt::format("node {} did not answer for {:.2f} s when asked {} object {}{}{}",
                                            node_, in_seconds(longest == 0ms ? timeout_ / 4 : timeout_), what,
                                            object.text(), besides(before), silence()));
      } catch (const std::system_error& e) {
        throw BusError(where(), fmt::format("{}", e.what()));
      }
      sdo_.await_silence();
      // Not in step with a master that asks at a fixed rate.
      std::this_thread::sleep_for(pause);
      pause = std::min(2 * pause, milliseconds(67));
    }
  }

  CanAddress at_;
  std::uint8_t node_;
  milliseconds timeout_;
  Descriptor channel_;
  Descriptor socket_;
  Heartbeats heartbeats_;
  SdoClient sdo_;
  std::uint32_t last_argument_ = 1;  ///< another client's may still be there
};

}  // namespace

std::unique_ptr<ControllerClient> connect_canopen(const BusAddress& address, const ClientOptions& options) {
  const auto& can = std::get<CanAddress>(address.at);
  const std::string where = address.text();
  Descriptor socket = open_can(can.interface, {{can.sdo_answer(), CAN_SFF_MASK}}, where);
  constexpr canid_t of_any_node = CAN_SFF_MASK & ~0x7FU;
  Descriptor unasked =
      open_can(can.interface, {{co::heartbeat_id, of_any_node}, {co::emergency_id, of_any_node}}, where);
  Descriptor channel = lock_channel(can, options, where);
  return std::make_unique<CanopenClient>(address, options, std::move(channel), std::move(socket),
                                         Heartbeats(std::move(unasked)));
}

std::unique_ptr<ControllerClient> connect_canopen(const BusAddress& address, const ClientOptions& options,
                                                  int socket) {
  return std::make_unique<CanopenClient>(address, options, Descriptor(), Descriptor(socket), Heartbeats());
}

}  // namespace flexcomp::host
