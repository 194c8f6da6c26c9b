// SPDX-License-Identifier: Apache-2.0
/// \file Bus ports: connect the firmware's servers to sockets and serial devices of Linux. A port lists the
/// descriptors to poll and serves without blocking.
#pragma once

#include <poll.h>

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "bus/bus_address.hpp"
#include "bus/descriptor.hpp"
#include "flexcomp_firmware/canopen.hpp"
#include "flexcomp_firmware/modbus.hpp"
#include "record_file.hpp"

namespace flexcomp::hil {

/// Milli- and microseconds of a monotonic clock, wrapping as the firmware expects.
std::uint32_t now_ms();
std::uint32_t now_us();

class Port {
 public:
  virtual ~Port() = default;
  virtual void wait_on(std::vector<pollfd>& descriptors) const = 0;
  virtual void serve() = 0;
  /// Address in the `ready` line.
  virtual std::string text() const = 0;
};

/// A CANopen node on SocketCAN.
class CanPort final : public Port {
 public:
  /// Keeps communication parameters in the file `memory`; with a CHANNEL in the address the second SDO server is open.
  /// \throws host::BusError  no such interface, not allowed, or a CHANNEL that this node cannot have
  CanPort(firmware::Device& device, firmware::Origin origin, const host::CanAddress& address,
          std::uint16_t heartbeat_ms, const std::string& memory);
  void wait_on(std::vector<pollfd>& descriptors) const override;
  void serve() override;
  std::string text() const override;

 private:
  static bool send(void* self, std::uint16_t id, const std::uint8_t* bytes, std::uint8_t size);
  void follow_channel();
  host::CanAddress address_;
  host::Descriptor socket_;
  RecordFile memory_;
  firmware::CanopenNode node_;
  std::uint32_t filtered_ = 0;  ///< COB-ID of 1201h that the socket lets through
  bool down_ = false;
};

/// Modbus TCP server: a listening socket and a fixed number of connections, each with its own server. Every connection gets
/// at most one longest frame's worth of bytes served in turn. Connections that are idle too long are closed; where all are
/// in use, docs/modbus.md says which one gives way to a new one (Modbus Messaging on TCP/IP V1.0b, 4.2.1).
class TcpPort final : public Port {
 public:
  /// `idle_ms`: time without an answered request after which a connection is closed; 0: none.
  /// \throws host::BusError  the address cannot be resolved or listened on
  TcpPort(firmware::Device& device, firmware::Origin first_origin, const host::ModbusTcpAddress& address,
          std::uint32_t idle_ms);
  void wait_on(std::vector<pollfd>& descriptors) const override;
  void serve() override;
  std::string text() const override;

  static constexpr std::size_t connections = 16;

 private:
  using Address = std::array<std::uint8_t, 16>;  ///< of IP, without the port
  struct Connection {
    Connection(firmware::Device& device, firmware::Origin origin) : server(device, origin) {}
    host::Descriptor socket;
    Address client{};
    firmware::ModbusServer server;
    std::unique_ptr<firmware::ModbusTcp> stream;
    std::vector<std::uint8_t> out;  ///< bytes not yet sent
    std::uint32_t used_ms = 0;      ///< time of the last answer, or of the beginning
    std::uint32_t ended_ms = 0;
    bool answered = false;     ///< some request has been answered
    bool ending = false;       ///< nothing more is taken in; closed when what is left has been sent
    bool is_finished = false;  ///< the client sends no more
    bool is_shut = false;      ///< nor do we
  };
  static void send(void* connection, const std::uint8_t* bytes, std::size_t size);
  static bool flush(Connection& c);
  static Address address_of(int socket);
  std::size_t connections_of(const Address& client) const;
  Connection* place_for_new(const Address& client);
  void accept();
  void close(Connection& c);
  void end(Connection& c, bool is_finished);
  void serve(Connection& c);

  host::ModbusTcpAddress address_;
  std::uint32_t idle_ms_;
  host::Descriptor listener_;
  std::vector<std::unique_ptr<Connection>> connections_;
  std::size_t first_ = 0;  ///< served first in this turn
};

/// Modbus RTU server on a serial device. A device that disappears (an unplugged adapter) is reopened.
class RtuPort final : public Port {
 public:
  /// \throws host::BusError  no such device, not a serial device, or a baud rate that it does not have
  RtuPort(firmware::Device& device, firmware::Origin origin, const host::ModbusRtuAddress& address);
  void wait_on(std::vector<pollfd>& descriptors) const override;
  void serve() override;
  std::string text() const override;

 private:
  static void send(void* self, const std::uint8_t* bytes, std::size_t size);
  host::Descriptor open() const;
  host::ModbusRtuAddress address_;
  host::Descriptor device_;
  firmware::ModbusServer server_;
  firmware::ModbusRtu line_;
  std::uint32_t closed_ms_ = 0;
  std::uint32_t heard_us_ = 0;
};

}  // namespace flexcomp::hil
