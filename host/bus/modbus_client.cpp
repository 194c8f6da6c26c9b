// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <modbus/modbus.h>
#include <netdb.h>
#include <sys/file.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <thread>
#include <utility>

#include "bus/controller_client.hpp"
#include "flexcomp/wire/modbus_map.hpp"
#include "flexcomp/wire/robot_record.hpp"
#include "flexcomp/wire/unit_record.hpp"

namespace flexcomp::host {
namespace {

namespace map = wire::modbus;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

struct Free {
  void operator()(modbus_t* context) const {
    modbus_close(context);
    modbus_free(context);
  }
};

void set_register(std::span<std::uint16_t> to, std::span<const std::uint8_t> bytes) {
  for (std::size_t k = 0; k < to.size(); ++k) {
    // The last low byte of an odd length is padding.
    const unsigned low = 2 * k + 1 < bytes.size() ? bytes[2 * k + 1] : 0U;
    to[k] = static_cast<std::uint16_t>((static_cast<unsigned>(bytes[2 * k]) << 8U) | low);
  }
}

void append(Bytes& to, std::span<const std::uint16_t> registers) {
  for (const std::uint16_t r : registers) {
    to.push_back(static_cast<std::uint8_t>(r >> 8U));
    to.push_back(static_cast<std::uint8_t>(r & 0xFFU));
  }
}

class ModbusClient final : public ControllerClient {
 public:
  ModbusClient(const BusAddress& address, const ClientOptions& options) : ControllerClient(address, options) {
    if (const auto* tcp = std::get_if<ModbusTcpAddress>(&address.at)) {
      is_tcp_ = true;
      open_tcp(*tcp);
    } else {
      open_rtu(std::get<ModbusRtuAddress>(address.at));
    }
    connect();
    read_capability();
  }

 protected:
  wire::ByteOrder byte_order() const override { return wire::ByteOrder::big; }
  unsigned connection() const override { return connections_ + (is_tcp_ && broken_ ? 1U : 0U); }

  Bytes read_record(Record record, std::size_t size) override {
    std::uint16_t from = map::capability;
    if (record == Record::status) from = map::status;
    if (record == Record::robot) from = map::robot;
    if (record == Record::unit) from = map::unit;
    Bytes out;
    std::array<std::uint16_t, map::most_read> registers{};
    for (std::size_t left = size / 2; left != 0;) {
      const std::size_t n = std::min<std::size_t>(left, map::most_read);
      send(
          fmt::format("to read {} registers from 0x{:04X}", n, from), attempts_,
          [&] { return modbus_read_registers(context_.get(), from, static_cast<int>(n), registers.data()); },
          true);
      append(out, {registers.data(), n});
      from = static_cast<std::uint16_t>(from + n);
      left -= n;
    }
    return out;
  }

  void send_image(std::span<const std::uint8_t> image, const Progress& progress) override {
    send_command(wire::Command::begin, static_cast<std::uint32_t>(image.size()));
    constexpr std::size_t window = 2 * std::size_t{map::staging_window_registers};
    std::array<std::uint16_t, 2 + map::staging_window_registers> registers{};
    for (std::size_t at = 0; at < image.size(); at += window) {
      const std::size_t size = std::min(window, image.size() - at);
      const std::size_t n = (size + 1) / 2;
      set_number(registers, at);
      set_register({registers.data() + 2, n}, image.subspan(at, size));
      send(fmt::format("to take the bytes from {} of the set", at), attempts_, [&] {
        return modbus_write_registers(context_.get(), map::staging_offset, static_cast<int>(2 + n),
                                      registers.data());
      });
      if (progress) progress(at + size, image.size());
    }
  }

  void send_command(wire::Command command, std::uint32_t argument) override {
    std::array<std::uint16_t, 3> registers{};
    set_number(registers, argument);
    registers[2] = static_cast<std::uint16_t>(command);
    // Sent once: a command whose answer got lost may have been executed. A set may be announced twice.
    const int attempts = command == wire::Command::begin ? attempts_ : 1;
    send(fmt::format("to {}", describe(command)), attempts, [&] {
      return modbus_write_registers(context_.get(), map::argument, static_cast<int>(registers.size()),
                                    registers.data());
    });
  }

  Bytes read_image(std::size_t size, const Progress& progress) override {
    Bytes out;
    std::array<std::uint16_t, 2> offset{};
    std::array<std::uint16_t, map::reading_window_registers> registers{};
    while (out.size() < size) {
      const std::size_t n = std::min<std::size_t>((size - out.size() + 1) / 2, registers.size());
      set_number(offset, out.size());
      send(
          fmt::format("for the bytes from {} of the active set", out.size()), attempts_,
          [&] {
            return modbus_write_and_read_registers(
                context_.get(), map::reading_offset, static_cast<int>(offset.size()), offset.data(),
                map::reading_window, static_cast<int>(n), registers.data());
          },
          true);
      append(out, {registers.data(), n});
      if (progress) progress(std::min(out.size(), size), size);
    }
    out.resize(size);
    return out;
  }

  Bytes exchange_probe(std::span<const std::uint8_t> request, bool with_flags) override {
    std::array<std::uint16_t, map::probe_request_registers + 1> question{};
    static_assert(map::probe_trigger == map::probe_request + map::probe_request_registers);
    set_register({question.data(), map::probe_request_registers}, request);
    question.back() = map::trigger_request;
    // The flags follow the response.
    static_assert(map::probe_flags == map::probe_response + map::probe_response_registers);
    std::array<std::uint16_t, map::probe_response_registers + 1> registers{};
    const auto answer = std::span(registers).first(registers.size() - (with_flags ? 0 : 1));
    send("to answer a probe", attempts_, [&] {
      return modbus_write_and_read_registers(
          context_.get(), map::probe_request, static_cast<int>(question.size()), question.data(),
          map::probe_response, static_cast<int>(answer.size()), answer.data());
    });
    Bytes out;
    append(out, answer);
    return out;
  }

 private:
  static void set_number(std::span<std::uint16_t> to, std::size_t value) {
    to[0] = static_cast<std::uint16_t>(value >> 16U);
    to[1] = static_cast<std::uint16_t>(value & 0xFFFFU);
  }

  void set_timeout(milliseconds timeout) {
    timeout_ = timeout;
    modbus_set_response_timeout(context_.get(), static_cast<std::uint32_t>(timeout.count() / 1000),
                                static_cast<std::uint32_t>(timeout.count() % 1000 * 1000));
  }

  void open_tcp(const ModbusTcpAddress& tcp) {
    unit_ = tcp.unit;
    // libmodbus reports an unknown host as a refused connection.
    addrinfo* found = nullptr;
    const int unknown = getaddrinfo(tcp.host.c_str(), nullptr, nullptr, &found);
    if (unknown != 0) {
      throw BusError(where(),
                     fmt::format("the host '{}' cannot be found: {}", tcp.host, gai_strerror(unknown)));
    }
    freeaddrinfo(found);
    context_.reset(modbus_new_tcp_pi(tcp.host.c_str(), std::to_string(tcp.port).c_str()));
    if (!context_) fail_to_open(errno);
    // TCP itself repeats lost packets.
    attempts_ = 1;
    set_timeout(options().response_timeout);
    modbus_set_slave(context_.get(), tcp.unit);
  }

  void open_rtu(const ModbusRtuAddress& rtu) {
    unit_ = rtu.unit;
    constexpr int data_bits = 8;
    constexpr int stop_bits = 1;
    context_.reset(modbus_new_rtu(rtu.device.c_str(), static_cast<int>(rtu.baud),
                                  static_cast<char>(rtu.parity), data_bits, stop_bits));
    if (!context_) fail_to_open(errno);
    attempts_ = 3;
    // libmodbus counts from the moment at which it hands the request to the system, before the line has sent it.
    constexpr unsigned bits_per_byte = 11;
    const auto line = milliseconds(2 * map::rtu_bytes * bits_per_byte * 1000 / rtu.baud + 1);
    set_timeout(options().response_timeout / attempts_ + line);
    modbus_set_slave(context_.get(), rtu.unit);
    device_ = rtu.device;
  }

  void connect() {
    if (modbus_connect(context_.get()) != 0) fail_to_open(errno);
    broken_ = false;
    if (is_tcp_) return;
    // One master on a serial line (Modbus over Serial Line V1.02, 2.1). The kernel frees the lock when the
    // process ends.
    const auto end = steady_clock::now() + options().response_timeout;
    while (flock(modbus_get_socket(context_.get()), LOCK_EX | LOCK_NB) != 0) {
      if (steady_clock::now() > end) {
        throw BusError(where(), fmt::format("another program on this machine has been using {} for {:.1f} s",
                                            device_, in_seconds(options().response_timeout)));
      }
      std::this_thread::sleep_for(milliseconds(20));
    }
  }

  /// After an error a connection may be gone, or hold the rest of an answer.
  void connect_anew() {
    modbus_close(context_.get());
    if (is_tcp_) ++connections_;
    connect();
  }

  /// An answer that is late must not be taken for that to the next request.
  void drop_late_answers() {
    std::this_thread::sleep_for(std::clamp(timeout_ / 20, milliseconds(5), milliseconds(50)));
    modbus_flush(context_.get());
    late_ = false;
  }

  [[noreturn]] void fail_to_open(int error) const {
    if (error == ETIMEDOUT) {
      throw NoAnswer(where(), fmt::format("no connection within {:.1f} s", in_seconds(timeout_)));
    }
    throw BusError(where(), fmt::format("cannot be opened: {}", modbus_strerror(error)),
                   ErrorCode::bus_not_opened);
  }

  /// What the exceptions of a controller mean.
  inline static const std::vector<std::pair<int, BusRefusal>> refusals{
      {EMBXSBUSY, {true, false, "Modbus exception 06, server device busy"}},
      {EMBXILADD, {false, true, "Modbus exception 02, no such register"}},
      {EMBXILFUN, {false, true, "Modbus exception 01, no such function"}},
      {EMBXILVAL, {false, false, "Modbus exception 03, illegal value"}},
      {EMBXSFAIL, {false, false, "Modbus exception 04, server device failure"}}};

  /// One request. Exceptions of the controller become BusRefusal, a time-out NoAnswer. One that only reads is asked once
  /// more over a new connection where the old one breaks.
  template <class Request>
  void send(const std::string& what, int attempts, const Request& request, bool only_reads = false) {
    if (broken_) connect_anew();
    if (late_) drop_late_answers();
    int error = 0;
    bool again = is_tcp_ && only_reads;
    for (int attempt = 0; attempt < attempts; ++attempt) {
      if (attempt != 0) drop_late_answers();
      if (request() >= 0) {
        late_ = attempt != 0;
        return;
      }
      error = errno;
      for (const auto& [exception, refusal] : refusals) {
        if (error == exception) throw refusal;
      }
      if (error == EMBXGPATH || error == EMBXGTAR) {
        throw BusError(where(),
                       fmt::format("the gateway cannot reach unit {} ({})", unit_, modbus_strerror(error)));
      }
      // A damaged or missing answer is worth another attempt, a broken connection is not.
      const bool damaged = error == ETIMEDOUT || (error >= EMBBADCRC && error < EMBBADCRC + 8);
      broken_ = is_tcp_ || !damaged;
      late_ = true;
      if (again && error != ETIMEDOUT) {
        again = false;
        connect_anew();
        --attempt;
        continue;
      }
      if (!damaged) break;
    }
    if (error == ETIMEDOUT) {
      throw NoAnswer(
          where(),
          fmt::format("unit {} did not answer when asked {} ({} of {:.1f} s)", unit_, what,
                      attempts == 1 ? "one wait" : fmt::format("{} waits", attempts), in_seconds(timeout_)));
    }
    throw BusError(where(), fmt::format("asked {}, unit {}: {}", what, unit_, modbus_strerror(error)));
  }

  std::unique_ptr<modbus_t, Free> context_;
  int attempts_ = 1;
  int unit_ = 0;
  milliseconds timeout_{0};
  bool is_tcp_ = false;
  bool broken_ = false;  ///< the next request opens the connection anew
  bool late_ = false;    ///< an answer to an earlier request may still come
  unsigned connections_ = 0;
  std::string device_;
};

}  // namespace

std::unique_ptr<ControllerClient> connect_modbus(const BusAddress& address, const ClientOptions& options) {
  return std::make_unique<ModbusClient>(address, options);
}

}  // namespace flexcomp::host
