// SPDX-License-Identifier: Apache-2.0
/// \file
/// The fake controller on Modbus TCP or a pseudo-terminal, by libmodbus, which can be told to misbehave.
#pragma once

#include <arpa/inet.h>
#include <fcntl.h>
#include <modbus/modbus.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include "bus/controller_client.hpp"
#include "flexcomp/wire/modbus_map.hpp"
#include "flexcomp/wire/unit_record.hpp"
#include "host/bus/bus_fake_controller.hpp"

namespace flexcomp::fake {

namespace map = wire::modbus;

/// The register map over the fake controller, in a thread. libmodbus parses requests and builds answers.
class ModbusServer {
 public:
  Controller device;
  std::atomic<bool> silent{false};
  std::atomic<int> lose{0};                ///< so many answers are lost
  std::atomic<bool> loses_commits{false};  ///< of commits; over TCP the connection ends with them

  explicit ModbusServer(bool serial) : serial_(serial) {
    if (serial) {
      master_ = ::posix_openpt(O_RDWR | O_NOCTTY);
      EXPECT_EQ(::grantpt(master_), 0);
      EXPECT_EQ(::unlockpt(master_), 0);
      device_path = ::ptsname(master_);
      termios raw{};
      ::tcgetattr(master_, &raw);
      ::cfmakeraw(&raw);
      ::tcsetattr(master_, TCSANOW, &raw);
      // Never connected: it only builds and parses frames, and talks through the terminal's master side.
      context_ = modbus_new_rtu(device_path.c_str(), 115200, 'N', 8, 1);
      modbus_set_slave(context_, 7);
      modbus_set_socket(context_, master_);
    } else {
      listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
      sockaddr_in at{};
      at.sin_family = AF_INET;
      at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      EXPECT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&at), sizeof at), 0);
      EXPECT_EQ(::listen(listener_, 1), 0);
      socklen_t size = sizeof at;
      ::getsockname(listener_, reinterpret_cast<sockaddr*>(&at), &size);
      port = ntohs(at.sin_port);
      context_ = modbus_new_tcp("127.0.0.1", port);
    }
    registers_ = modbus_mapping_new(0, 0, 0x1000, 0);
    thread_ = std::thread([this] { serial_ ? serve() : accept_and_serve(); });
  }
  ~ModbusServer() {
    stop_ = true;
    thread_.join();
    modbus_mapping_free(registers_);
    modbus_free(context_);
    if (listener_ >= 0) ::close(listener_);
    if (master_ >= 0) ::close(master_);
  }

  host::BusAddress address() const {
    if (serial_) return {host::ModbusRtuAddress{device_path, 115200, host::Parity::none, 7}};
    return {host::ModbusTcpAddress{"127.0.0.1", port, 255}};
  }

  std::unique_ptr<host::ControllerClient> client() const { return host::connect(address(), quick()); }

  std::uint16_t port = 0;
  std::string device_path;

 private:
  bool ready(int fd) const {
    pollfd p{fd, POLLIN, 0};
    while (!stop_) {
      if (::poll(&p, 1, 5) <= 0) continue;
      if ((p.revents & POLLIN) != 0) return true;
      if (!serial_) return false;
      // Nobody has the line open at the moment.
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  }
  void accept_and_serve() {
    while (ready(listener_)) {
      const int fd = ::accept(listener_, nullptr, nullptr);
      modbus_set_socket(context_, fd);
      serve();
      ::close(fd);
    }
  }

  std::uint16_t* at(unsigned address) { return registers_->tab_registers + address; }
  void put(unsigned address, const Bytes& bytes) {
    for (std::size_t k = 0; k < bytes.size(); k += 2) {
      const unsigned low = k + 1 < bytes.size() ? bytes[k + 1] : 0U;
      at(address)[k / 2] = static_cast<std::uint16_t>((unsigned{bytes[k]} << 8U) | low);
    }
  }
  std::uint32_t number(unsigned address) { return (std::uint32_t{at(address)[0]} << 16U) | at(address)[1]; }
  Bytes get(unsigned address, std::size_t size) {
    Bytes out;
    for (std::size_t k = 0; k < size; ++k) {
      out.push_back(
          static_cast<std::uint8_t>(k % 2 == 0 ? at(address)[k / 2] >> 8U : at(address)[k / 2] & 0xFFU));
    }
    return out;
  }

  void serve() {
    const int fd = modbus_get_socket(context_);
    std::uint8_t query[MODBUS_RTU_MAX_ADU_LENGTH + 16];
    while (ready(fd)) {
      const int size = modbus_receive(context_, query);
      if (size == -1 && !serial_) return;
      if (size <= 0 || silent) continue;
      answer(query, size);
    }
  }

  void answer(const std::uint8_t* query, int size) {
    const int head = modbus_get_header_length(context_);
    const std::uint8_t* pdu = query + head;
    const unsigned address = (unsigned{pdu[1]} << 8U) | pdu[2];
    constexpr auto big = wire::ByteOrder::big;
    // What is written is seen first, so that answers to function 23 hold its effect.
    unsigned to = 0;
    unsigned count = 0;
    const std::uint8_t* data = nullptr;
    if (pdu[0] == 0x10) {
      to = address;
      count = pdu[5] / 2U;
      data = pdu + 6;
    } else if (pdu[0] == 0x17) {
      to = (unsigned{pdu[5]} << 8U) | pdu[6];
      count = pdu[9] / 2U;
      data = pdu + 10;
    }
    for (unsigned k = 0; k < count; ++k) {
      at(to + k)[0] = static_cast<std::uint16_t>((unsigned{data[2 * k]} << 8U) | data[2 * k + 1]);
    }
    wire::Answer answered = wire::Answer::accepted;
    if (count != 0 && to == map::argument) {
      answered = device.run(static_cast<wire::Command>(at(map::command)[0]), number(map::argument));
    } else if (count != 0 && to == map::staging_offset) {
      const Bytes bytes = get(map::staging_window, 2 * std::size_t{count - 2});
      const std::size_t from = number(map::staging_offset);
      for (std::size_t k = 0; k < bytes.size() && from + k < device.staged.size(); ++k) {
        device.staged[from + k] = bytes[k];
      }
    } else if (count != 0 && to == map::reading_offset) {
      const std::size_t from = number(map::reading_offset);
      put(map::reading_window,
          {device.active.begin() + static_cast<std::ptrdiff_t>(from),
           device.active.begin() + static_cast<std::ptrdiff_t>(std::min(device.active.size(), from + 246))});
    } else if (count != 0 && to == map::probe_request) {
      wire::ProbeRequest request;
      wire::decode(get(map::probe_request, wire::probe_request_bytes).data(), big, request);
      Bytes response(wire::probe_response_bytes);
      const wire::ProbeResponse answer = device.probe(request);
      wire::encode(answer, big, response.data());
      put(map::probe_response, response);
      if (device.tells_flags()) at(map::probe_flags)[0] = answer.flags;
    }
    put(map::capability, device.capability_record(big));
    if (count == 0 && address == map::status) put(map::status, device.status_record(big));
    put(map::robot, device.robot_record(big));
    put(map::unit, device.unit_record(big));
    if (lose > 0) {
      --lose;
      return;
    }
    const auto command = static_cast<wire::Command>(at(map::command)[0]);
    if (loses_commits && to == map::argument && count != 0 && command == wire::Command::commit) {
      if (!serial_) ::shutdown(modbus_get_socket(context_), SHUT_RDWR);
      return;
    }
    if (answered != wire::Answer::accepted) {
      modbus_reply_exception(context_, query,
                             answered == wire::Answer::busy ? MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY
                                                            : MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE);
    } else if (count == 0 && address >= map::robot && !device.tells_robot) {
      modbus_reply_exception(context_, query, MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS);
    } else {
      modbus_reply(context_, query, size, registers_);
    }
  }

  bool serial_;
  int listener_ = -1;
  int master_ = -1;
  modbus_t* context_ = nullptr;
  modbus_mapping_t* registers_ = nullptr;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace flexcomp::fake
