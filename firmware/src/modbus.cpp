// SPDX-License-Identifier: Apache-2.0
#include "flexcomp_firmware/modbus.hpp"

#include <array>
#include <cstddef>
#include <cstring>

#include "flexcomp/wire/modbus_blocks.hpp"

namespace flexcomp {
namespace firmware {

namespace map = wire::modbus;
using map::Exception;

namespace {

constexpr std::uint8_t read_holding_registers = 0x03;
constexpr std::uint8_t read_input_registers = 0x04;
constexpr std::uint8_t write_single_register = 0x06;
constexpr std::uint8_t diagnostics = 0x08;
constexpr std::uint8_t get_comm_event_counter = 0x0B;
constexpr std::uint8_t write_multiple_registers = 0x10;
constexpr std::uint8_t report_server_id = 0x11;
constexpr std::uint8_t read_write_registers = 0x17;
constexpr std::uint8_t encapsulated_interface = 0x2B;
constexpr std::uint8_t read_device_identification = 0x0E;

std::uint16_t be16(const std::uint8_t* p) { return static_cast<std::uint16_t>((p[0] << 8U) | p[1]); }

void put16(std::uint8_t* p, std::uint32_t v) {
  p[0] = static_cast<std::uint8_t>(v >> 8U);
  p[1] = static_cast<std::uint8_t>(v);
}

void put32(std::uint8_t* p, std::uint32_t v) {
  put16(p, v >> 16U);
  put16(p + 2, v);
}

using map::Block;

struct BlockPlace {
  Block block;
  std::uint16_t address;
  std::uint16_t registers;
  bool readable;
  bool writable;
  bool harmless;  ///< nothing of a set is changed by it: may be written by a broadcast
};

/// What a range of registers is wanted for.
enum class Access : std::uint8_t { read, write, broadcast };

/// The map without names and texts, made at compile time so that they take no flash.
constexpr std::array<BlockPlace, map::block_count> served() {
  std::array<BlockPlace, map::block_count> out{};
  for (std::size_t k = 0; k < map::block_count; ++k) {
    const map::BlockDescription& d = map::block_descriptions[k];
    const bool harmless = d.block == Block::reading_offset || d.block == Block::probe_request ||
                          d.block == Block::probe_trigger;
    out[k] = BlockPlace{d.block, d.address, d.registers, d.readable, d.writable, harmless};
  }
  return out;
}
constexpr std::array<BlockPlace, map::block_count> blocks = served();

const BlockPlace* block_at(std::uint32_t address) {
  for (const BlockPlace& b : blocks) {
    if (address >= b.address && address < static_cast<std::uint32_t>(b.address) + b.registers) return &b;
  }
  return nullptr;
}

/// True where all registers of a range exist and may be accessed so.
bool range_exists(std::uint32_t address, std::uint32_t quantity, Access access) {
  if (address + quantity > 0x10000U) return false;
  while (quantity != 0) {
    const BlockPlace* b = block_at(address);
    if (b == nullptr || !(access == Access::read ? b->readable : b->writable)) return false;
    if (access == Access::broadcast && !b->harmless) return false;
    const std::uint32_t left = b->address + b->registers - address;
    const std::uint32_t n = quantity < left ? quantity : left;
    address += n;
    quantity -= n;
  }
  return true;
}

/// Writes some registers of a two-register number.
void patch32(std::uint32_t& value, std::uint32_t first, std::uint32_t quantity, const std::uint8_t* from) {
  std::uint8_t bytes[4];
  put32(bytes, value);
  std::memcpy(bytes + 2 * first, from, 2 * static_cast<std::size_t>(quantity));
  value = (static_cast<std::uint32_t>(be16(bytes)) << 16U) | be16(bytes + 2);
}

Exception exception_of(wire::Answer a) {
  if (a == wire::Answer::accepted) return Exception::none;
  return a == wire::Answer::busy ? Exception::server_device_busy : Exception::server_device_failure;
}

std::size_t refuse(std::uint8_t function, Exception e, std::uint8_t* out) {
  out[0] = static_cast<std::uint8_t>(function | 0x80U);
  out[1] = static_cast<std::uint8_t>(e);
  return 2;
}

}  // namespace

Exception ModbusServer::read(std::uint32_t address, std::uint32_t quantity, std::uint8_t* out) {
  std::uint8_t scratch[wire::robot_record_bytes];
  while (quantity != 0) {
    const BlockPlace* b = block_at(address);
    if (b == nullptr) return Exception::illegal_data_address;
    const std::uint32_t first = address - b->address;
    const std::uint32_t n = quantity < b->registers - first ? quantity : b->registers - first;
    const std::uint8_t* from = scratch;
    switch (b->block) {
      case Block::capability:
        wire::encode(device_.capability(), wire::ByteOrder::big, scratch);
        break;
      case Block::status:
        wire::encode(device_.status(), wire::ByteOrder::big, scratch);
        break;
      case Block::argument:
        put32(scratch, argument_);
        break;
      case Block::command:
        put16(scratch, command_);
        break;
      case Block::staging_offset:
        put32(scratch, staging_offset_);
        break;
      case Block::reading_offset:
        put32(scratch, reading_offset_);
        break;
      case Block::reading_window: {
        // The image may have an odd length; its last register is then padded.
        const std::uint32_t bytes = device_.store().active_bytes();
        const std::uint32_t at = reading_offset_ + 2 * first;
        if (reading_offset_ > bytes || at >= bytes || 2 * n > bytes - at + (bytes & 1U)) {
          return Exception::illegal_data_address;
        }
        const std::uint32_t size = 2 * n < bytes - at ? 2 * n : bytes - at;
        scratch[2 * first + 2 * n - 1] = 0;
        if (!device_.store().read_active(at, scratch + 2 * static_cast<std::size_t>(first), size)) {
          return Exception::server_device_failure;
        }
        break;
      }
      case Block::probe_request:
        from = probe_request_.data();
        break;
      case Block::probe_trigger:
        put16(scratch, trigger_);
        break;
      case Block::probe_response:
        from = probe_response_.data();
        break;
      case Block::probe_flags:
        put16(scratch, probe_flags_);
        break;
      case Block::corrections:
        for (std::size_t k = 0; k < map::corrections_registers / 2; ++k) {
          const float v = device_.correction_deg(k);
          std::uint32_t bits;
          std::memcpy(&bits, &v, sizeof bits);
          put32(scratch + 4 * k, bits);
        }
        break;
      case Block::robot:
        device_.robot_record(wire::ByteOrder::big, scratch);
        break;
      case Block::certificate:
        wire::encode(device_.certificate(), wire::ByteOrder::big, scratch);
        break;
      case Block::unit:
        wire::encode(device_.unit(), wire::ByteOrder::big, scratch);
        break;
      case Block::staging_window:
        return Exception::illegal_data_address;
    }
    std::memcpy(out, from + 2 * static_cast<std::size_t>(first), 2 * static_cast<std::size_t>(n));
    out += 2 * static_cast<std::size_t>(n);
    address += n;
    quantity -= n;
  }
  return Exception::none;
}

Exception ModbusServer::apply(std::uint32_t address, std::uint32_t quantity, const std::uint8_t* from) {
  const BlockPlace* b = block_at(address);
  if (b == nullptr) return Exception::illegal_data_address;
  const std::uint32_t first = address - b->address;
  switch (b->block) {
    case Block::argument:
      patch32(argument_, first, quantity, from);
      return Exception::none;
    case Block::command:
      command_ = be16(from);
      return exception_of(device_.run(static_cast<wire::Command>(command_), argument_, origin_));
    case Block::staging_offset:
      patch32(staging_offset_, first, quantity, from);
      return Exception::none;
    case Block::staging_window: {
      std::uint32_t size = 2 * quantity;
      // Offset arithmetic must not wrap; far beyond any image it is refused by the store.
      const std::uint32_t at = staging_offset_ < 0x80000000U ? staging_offset_ + 2 * first : 0x80000000U;
      const std::uint32_t announced = device_.store().announced_bytes();
      if ((announced & 1U) != 0 && at + size == announced + 1U) --size;
      return exception_of(device_.store().write(at, from, size, origin_));
    }
    case Block::reading_offset:
      patch32(reading_offset_, first, quantity, from);
      return Exception::none;
    case Block::probe_request:
      std::memcpy(probe_request_.data() + 2 * static_cast<std::size_t>(first), from,
                  2 * static_cast<std::size_t>(quantity));
      return Exception::none;
    case Block::probe_trigger: {
      trigger_ = be16(from);
      if (trigger_ == 0) return Exception::none;
      if (trigger_ != map::trigger_request && trigger_ != map::trigger_default_context) {
        return Exception::server_device_failure;
      }
      wire::ProbeRequest request;
      wire::decode(probe_request_.data(), wire::ByteOrder::big, request);
      if (trigger_ == map::trigger_default_context) request = device_.with_default_context(request);
      const wire::ProbeResponse response = device_.probe(request);
      wire::encode(response, wire::ByteOrder::big, probe_response_.data());
      probe_flags_ = response.flags;
      return Exception::none;
    }
    case Block::capability:
    case Block::status:
    case Block::reading_window:
    case Block::probe_response:
    case Block::probe_flags:
    case Block::corrections:
    case Block::robot:
    case Block::certificate:
    case Block::unit:
      break;
  }
  return Exception::illegal_data_address;
}

/// The range has been checked: it exists and may be written.
Exception ModbusServer::write(std::uint32_t address, std::uint32_t quantity, const std::uint8_t* from) {
  while (quantity != 0) {
    const BlockPlace* b = block_at(address);
    if (b == nullptr) return Exception::illegal_data_address;
    const std::uint32_t left = b->address + b->registers - address;
    const std::uint32_t n = quantity < left ? quantity : left;
    const Exception e = apply(address, n, from);
    if (e != Exception::none) return e;
    address += n;
    quantity -= n;
    from += 2 * static_cast<std::size_t>(n);
  }
  return Exception::none;
}

/// Read Device Identification (V1.1b3, 6.21): the three basic objects, as a stream or one by one.
///   request   2B 0E code object
///   response  2B 0E code 81 00 00 number (object length value) …
std::size_t ModbusServer::identify(const std::uint8_t* request, std::size_t size, std::uint8_t* out) const {
  if (size < 2 || request[1] != read_device_identification) {
    return refuse(encapsulated_interface, Exception::illegal_function, out);
  }
  if (size != 4 || request[2] < 1 || request[2] > 4) {
    return refuse(encapsulated_interface, Exception::illegal_data_value, out);
  }
  static const char* const texts[3] = {"flexcomp", "flexcomp", firmware_version_text};
  const bool one = request[2] == 4;
  std::uint8_t object = request[3];
  if (object > 2) {
    if (one) return refuse(encapsulated_interface, Exception::illegal_data_address, out);
    object = 0;  // "if the object id does not match any known object, the server responds as if object 0"
  }
  out[0] = encapsulated_interface;
  out[1] = read_device_identification;
  out[2] = request[2];
  out[3] = 0x81;  // conformity: basic identification, stream and individual access
  out[4] = 0;     // no more follows
  out[5] = 0;
  out[6] = 0;
  std::size_t at = 7;
  for (; object <= 2; ++object) {
    const std::size_t length = std::strlen(texts[object]);
    out[at] = object;
    out[at + 1] = static_cast<std::uint8_t>(length);
    std::memcpy(out + at + 2, texts[object], length);
    at += 2 + length;
    ++out[6];
    if (one) break;
  }
  return at;
}

/// Report Server ID (V1.1b3, 6.13): 11 -> 11, byte count, server ID, run indicator, additional data.
std::size_t ModbusServer::report(std::size_t size, std::uint8_t* out) const {
  if (size != 1) return refuse(report_server_id, Exception::illegal_data_value, out);
  static const char name[] = "flexcomp ";
  constexpr std::size_t name_size = sizeof name - 1;
  constexpr std::size_t version_size = sizeof firmware_version_text - 1;
  out[0] = report_server_id;
  out[1] = static_cast<std::uint8_t>(2 + name_size + version_size);
  out[2] = map::server_id;
  out[3] = device_.store().active_sequence() != 0 ? 0xFF : 0x00;
  std::memcpy(out + 4, name, name_size);
  std::memcpy(out + 4 + name_size, firmware_version_text, version_size);
  return 4 + name_size + version_size;
}

std::size_t ModbusServer::answer(const std::uint8_t* request, std::size_t size, std::uint8_t* out) {
  return serve(request, size, out, false);
}

std::size_t ModbusServer::broadcast(const std::uint8_t* request, std::size_t size, std::uint8_t* out) {
  return serve(request, size, out, true);
}

std::size_t ModbusServer::serve(const std::uint8_t* request, std::size_t size, std::uint8_t* out,
                                bool is_broadcast) {
  if (size == 0) return 0;
  const std::uint8_t function = request[0];
  const Access to_write = is_broadcast ? Access::broadcast : Access::write;
  if (is_broadcast && function != write_single_register && function != write_multiple_registers) {
    return refuse(function, Exception::illegal_function, out);
  }
  switch (function) {
    case read_holding_registers:
    case read_input_registers: {
      // 6.3, 6.4: 03|04, address (2), quantity (2) -> 03|04, byte count, registers
      if (size != 5) return refuse(function, Exception::illegal_data_value, out);
      const std::uint32_t address = be16(request + 1);
      const std::uint32_t quantity = be16(request + 3);
      if (quantity < 1 || quantity > map::most_read) {
        return refuse(function, Exception::illegal_data_value, out);
      }
      if (!range_exists(address, quantity, Access::read)) {
        return refuse(function, Exception::illegal_data_address, out);
      }
      out[0] = function;
      out[1] = static_cast<std::uint8_t>(2 * quantity);
      const Exception e = read(address, quantity, out + 2);
      return e == Exception::none ? 2 + 2 * static_cast<std::size_t>(quantity) : refuse(function, e, out);
    }
    case write_single_register: {
      // 6.6: 06, address (2), value (2) -> the same
      if (size != 5) return refuse(function, Exception::illegal_data_value, out);
      const std::uint32_t address = be16(request + 1);
      if (!range_exists(address, 1, to_write)) return refuse(function, Exception::illegal_data_address, out);
      const Exception e = write(address, 1, request + 3);
      if (e != Exception::none) return refuse(function, e, out);
      std::memcpy(out, request, 5);
      return 5;
    }
    case diagnostics: {
      // 6.8: 08, sub-function 00 (Return Query Data), N x 2 bytes -> the same. The other sub-functions are those of
      // a serial line (ModbusRtu::diagnose).
      if (size < 3) return refuse(function, Exception::illegal_data_value, out);
      if (be16(request + 1) != 0) return refuse(function, Exception::illegal_function, out);
      if (size < 5 || size % 2 == 0 || size > map::pdu_bytes) {
        return refuse(function, Exception::illegal_data_value, out);
      }
      std::memmove(out, request, size);
      return size;
    }
    case write_multiple_registers: {
      // 6.12: 10, address (2), quantity (2), byte count, registers -> 10, address, quantity
      if (size < 6) return refuse(function, Exception::illegal_data_value, out);
      const std::uint32_t address = be16(request + 1);
      const std::uint32_t quantity = be16(request + 3);
      if (quantity < 1 || quantity > map::most_written || request[5] != 2 * quantity ||
          size != 6 + 2 * static_cast<std::size_t>(quantity)) {
        return refuse(function, Exception::illegal_data_value, out);
      }
      if (!range_exists(address, quantity, to_write)) {
        return refuse(function, Exception::illegal_data_address, out);
      }
      const Exception e = write(address, quantity, request + 6);
      if (e != Exception::none) return refuse(function, e, out);
      std::memcpy(out, request, 5);
      return 5;
    }
    case read_write_registers: {
      // 6.17: 17, read address (2), quantity (2), write address (2), quantity (2), byte count, registers
      //       -> 17, byte count, registers
      if (size < 10) return refuse(function, Exception::illegal_data_value, out);
      const std::uint32_t from = be16(request + 1);
      const std::uint32_t reads = be16(request + 3);
      const std::uint32_t to = be16(request + 5);
      const std::uint32_t writes = be16(request + 7);
      if (reads < 1 || reads > map::most_read || writes < 1 || writes > map::most_written_by_23 ||
          request[9] != 2 * writes || size != 10 + 2 * static_cast<std::size_t>(writes)) {
        return refuse(function, Exception::illegal_data_value, out);
      }
      if (!range_exists(from, reads, Access::read) || !range_exists(to, writes, Access::write)) {
        return refuse(function, Exception::illegal_data_address, out);
      }
      // "The write operation is performed before the read" (6.17).
      Exception e = write(to, writes, request + 10);
      if (e != Exception::none) return refuse(function, e, out);
      out[0] = function;
      out[1] = static_cast<std::uint8_t>(2 * reads);
      e = read(from, reads, out + 2);
      return e == Exception::none ? 2 + 2 * static_cast<std::size_t>(reads) : refuse(function, e, out);
    }
    case encapsulated_interface:
      return identify(request, size, out);
    case report_server_id:
      return report(size, out);
    default:
      return refuse(function, Exception::illegal_function, out);
  }
}

void ModbusServer::disconnect() {
  device_.store().disconnect(origin_);
  argument_ = 0;
  command_ = 0;
  staging_offset_ = 0;
  reading_offset_ = 0;
  trigger_ = 0;
  probe_request_ = {};
  probe_response_ = {};
  probe_flags_ = 0;
}

// --- RTU ----------------------------------------------------------------------------------------------

std::uint16_t modbus_crc(const std::uint8_t* bytes, std::size_t size, std::uint16_t crc) {
  static const std::uint16_t nibble[16] = {0x0000, 0xCC01, 0xD801, 0x1400, 0xF001, 0x3C00, 0x2800, 0xE401,
                                           0xA001, 0x6C00, 0x7800, 0xB401, 0x5000, 0x9C01, 0x8801, 0x4400};
  for (std::size_t i = 0; i < size; ++i) {
    crc = static_cast<std::uint16_t>(crc ^ bytes[i]);
    crc = static_cast<std::uint16_t>((crc >> 4U) ^ nibble[crc & 15U]);
    crc = static_cast<std::uint16_t>((crc >> 4U) ^ nibble[crc & 15U]);
  }
  return crc;
}

namespace {

/// Silence between two frames above 19200 baud (V1.02, 2.5.1.1).
constexpr std::uint32_t frame_silence_us = 1750;

/// Shortest frame: unit, function, CRC.
constexpr std::size_t shortest = 4;

/// expected(): Return Query Data, of which only checksum and silence tell the end.
constexpr std::size_t any_even = 1;

// Sub-functions of Diagnostics (V1.1b3, 6.8.1).
constexpr std::uint32_t return_query_data = 0;
constexpr std::uint32_t restart_communications = 1;
constexpr std::uint32_t return_diagnostic_register = 2;
constexpr std::uint32_t force_listen_only = 4;
constexpr std::uint32_t clear_counters = 10;
constexpr std::uint32_t first_counter = 11;
constexpr std::uint32_t clear_overruns = 20;

/// Restart and clear: of Diagnostics, not the other functions.
bool clears_counters(const std::uint8_t* request) {
  const std::uint32_t sub = be16(request + 1);
  return sub == restart_communications || sub == clear_counters;
}

/// The state of the CRC before the byte that took it to `crc`: the step of modbus_crc backwards.
std::uint16_t crc_before(std::uint8_t byte, std::uint16_t crc) {
  std::uint32_t c = crc;
  for (unsigned bit = 0; bit < 8; ++bit) c = (c & 0x8000U) != 0 ? ((c ^ 0xA001U) << 1U) | 1U : c << 1U;
  return static_cast<std::uint16_t>(c ^ byte);
}

}  // namespace

bool ModbusRtu::is_ours(std::size_t from) const { return frame_[from] == unit_ || frame_[from] == 0; }

/// Length of the request frame that begins at `from`, 0 where it is not known (yet), any_even.
std::size_t ModbusRtu::expected(std::size_t from) const {
  const std::size_t size = size_ - from;
  const std::uint8_t* frame = frame_.data() + from;
  if (size < 2) return 0;
  switch (frame[1]) {
    case 0x01:
    case 0x02:
    case read_holding_registers:
    case read_input_registers:
    case 0x05:
    case write_single_register:
      return 8;
    case diagnostics:
      if (size < 4) return 0;
      return be16(frame + 2) == return_query_data ? any_even : 8;
    case 0x07:
    case get_comm_event_counter:
    case 0x0C:
    case report_server_id:
      return 4;
    case 0x0F:
    case write_multiple_registers:
      return size < 7 ? 0 : 9 + static_cast<std::size_t>(frame[6]);
    case 0x16:
      return 10;
    case read_write_registers:
      return size < 11 ? 0 : 13 + static_cast<std::size_t>(frame[10]);
    case encapsulated_interface:
      return size < 3 || frame[2] != read_device_identification ? 0 : 7;
    default:
      return 0;
  }
}

/// Diagnostics and event counter of a line (V1.1b3, 6.8 and 6.9). Length of the answer, 0: none is given.
std::size_t ModbusRtu::diagnose(const std::uint8_t* request, std::size_t size, std::uint8_t* out) {
  if (request[0] == get_comm_event_counter) {
    // 0B -> 0B, status (2), event count (2); status 0: nothing is being processed
    if (size != 1) return refuse(request[0], Exception::illegal_data_value, out);
    out[0] = request[0];
    put16(out + 1, 0);
    put16(out + 3, events_);
    return 5;
  }
  const std::uint32_t sub = be16(request + 1);
  const bool is_counter = sub >= first_counter && sub < first_counter + counters_.size();
  if (!is_counter && sub != restart_communications && sub != return_diagnostic_register &&
      sub != force_listen_only && sub != clear_counters && sub != clear_overruns) {
    return refuse(diagnostics, Exception::illegal_function, out);
  }
  if (size != 5) return refuse(diagnostics, Exception::illegal_data_value, out);
  const std::uint32_t data = be16(request + 3);
  if (data != 0 && !(sub == restart_communications && data == 0xFF00U)) {
    return refuse(diagnostics, Exception::illegal_data_value, out);
  }
  std::memcpy(out, request, 5);
  if (is_counter) put16(out + 3, counters_[sub - first_counter]);
  if (sub == return_diagnostic_register) put16(out + 3, server_.faults());
  if (clears_counters(request)) {
    counters_ = {};
    events_ = 0;
  }
  if (sub == clear_overruns) count(Counter::overruns) = 0;
  if (sub == force_listen_only) {
    listens_only_ = true;
    return 0;
  }
  return 5;
}

/// Takes the frame from `from` to the end of what came in, whose CRC is right.
void ModbusRtu::take_frame(std::size_t from) {
  if (from != 0) damaged();
  const std::uint8_t unit = frame_[from];
  const std::uint8_t* request = frame_.data() + from + 1;
  const std::size_t size = size_ - from - 3;
  forget();
  ++count(Counter::messages);
  if (unit != unit_ && unit != 0) return;
  const bool on_the_line =
      unit != 0 && (request[0] == get_comm_event_counter ||
                    (request[0] == diagnostics && size >= 3 && be16(request + 1) != return_query_data));
  if (listens_only_) {
    // "The only function that will be processed … will be the Restart Communications Option" (6.8.1).
    ++count(Counter::unanswered);
    std::uint8_t unsent[5];
    if (on_the_line && request[0] == diagnostics && be16(request + 1) == restart_communications) {
      listens_only_ = diagnose(request, size, unsent) != 5;
    }
    return;
  }
  ++count(Counter::addressed);
  std::uint8_t out[wire::modbus::rtu_bytes];
  std::size_t n = 0;
  if (on_the_line) {
    n = diagnose(request, size, out + 1);
  } else {
    n = unit == 0 ? server_.broadcast(request, size, out + 1) : server_.answer(request, size, out + 1);
  }
  if (n != 0 && (out[1] & 0x80U) != 0) {
    ++count(Counter::exceptions);
    if (out[2] == static_cast<std::uint8_t>(Exception::server_device_busy)) ++count(Counter::busy);
  } else if (request[0] != get_comm_event_counter && !(on_the_line && clears_counters(request))) {
    ++events_;
  }
  if (unit == 0 || n == 0 || transmit_.send == nullptr) {
    ++count(Counter::unanswered);
    return;
  }
  out[0] = unit_;
  const std::uint16_t crc = modbus_crc(out, n + 1);
  out[n + 1] = static_cast<std::uint8_t>(crc);
  out[n + 2] = static_cast<std::uint8_t>(crc >> 8U);
  transmit_.send(transmit_.user, out, n + 3);
}

void ModbusRtu::forget() {
  size_ = 0;
  crc_ = 0xFFFF;
  lost_ = false;
  damaged_ = false;
  overrun_ = false;
  marked_ = false;
  marks_ = {};
}

/// What cannot be read since the last frame or gap counts as one error.
void ModbusRtu::damaged() {
  if (!damaged_) ++count(Counter::errors);
  damaged_ = true;
}

bool ModbusRtu::is_mark(std::size_t at) const { return (marks_[at / 8] >> (at % 8) & 1U) != 0; }

/// Takes a frame that begins after a silence and ends with what has come in.
void ModbusRtu::take_marked() {
  for (std::size_t from = 1; from + shortest <= size_; ++from) {
    if (!is_mark(from)) continue;
    const std::size_t n = size_ - from;
    const std::size_t length = expected(from);
    if (n != (length == any_even ? 8 : length) || modbus_crc(frame_.data() + from, n) != 0) continue;
    take_frame(from);
    return;
  }
}

/// The buffer is full and holds no frame: what may still be one begins after a silence.
void ModbusRtu::make_room() {
  damaged();
  if (!overrun_) ++count(Counter::overruns);
  overrun_ = true;
  std::size_t first = 1;
  while (first < size_ && !is_mark(first)) ++first;
  lost_ = first == size_;
  size_ -= first;
  std::memmove(frame_.data(), frame_.data() + first, size_);
  crc_ = modbus_crc(frame_.data(), size_);
  const auto old = marks_;
  marks_ = {};
  for (std::size_t at = 1; at < size_; ++at) {
    const std::size_t was = at + first;
    if ((old[was / 8] >> (was % 8) & 1U) != 0) set_mark(at);
  }
}

void ModbusRtu::set_mark(std::size_t at) {
  marks_[at / 8] = static_cast<std::uint8_t>(marks_[at / 8] | (1U << (at % 8)));
  marked_ = true;
}

/// The line is silent: what came in ends here. It is a frame from its first byte (an unknown function code), or after
/// noise from a later one: the state of the CRC is followed backwards to where it is the initial one.
void ModbusRtu::gap() {
  if (!lost_ && size_ >= shortest && crc_ == 0) {
    take_frame(0);
    return;
  }
  std::size_t found = size_;
  std::uint16_t crc = 0;
  for (std::size_t from = size_; from-- > 1;) {
    crc = crc_before(frame_[from], crc);
    const std::size_t n = size_ - from;
    if (crc != 0xFFFF || n < shortest || !is_ours(from)) continue;
    const std::size_t length = expected(from);
    if (length == n || (length == any_even && n >= 8 && n % 2 == 0) || (length == 0 && is_mark(from)))
      found = from;
  }
  if (found != size_) {
    take_frame(found);
    return;
  }
  damaged();
  forget();
}

void ModbusRtu::receive(const std::uint8_t* bytes, std::size_t size, std::uint32_t now_us) {
  poll(now_us);
  if (size == 0) return;
  const bool is_after_silence = now_us - last_us_ >= frame_silence_us;
  last_us_ = now_us;
  if (is_after_silence && size_ == frame_.size()) make_room();
  if (is_after_silence && size_ == 0) lost_ = false;
  if (is_after_silence && size_ != 0 && (bytes[0] == unit_ || bytes[0] == 0)) set_mark(size_);
  for (std::size_t i = 0; i < size; ++i) {
    if (size_ == frame_.size()) make_room();
    frame_[size_++] = bytes[i];
    if (lost_) continue;
    crc_ = modbus_crc(bytes + i, 1, crc_);
    if (!is_ours(0)) {
      if (size_ >= shortest && crc_ == 0) take_frame(0);  // request or answer of another unit
      continue;
    }
    const std::size_t n = expected(0);
    if (n == any_even) {
      // One part in 65,536 of a longer one has a right checksum as well: byte by byte it ends at the gap.
      const bool may_end = i + 1 == size && (size > 1 || size_ == 8);
      if (may_end && size_ >= 8 && size_ % 2 == 0 && crc_ == 0) take_frame(0);
    } else if (n != 0 && size_ == n && crc_ == 0) {
      take_frame(0);
    } else if (n != 0 && (size_ >= n || n > frame_.size())) {
      lost_ = true;
    }
  }
  if (marked_) take_marked();
}

void ModbusRtu::line_error(bool overrun) {
  if (overrun) ++count(Counter::overruns);
  damaged();
  lost_ = damaged_ = size_ != 0;
}

void ModbusRtu::poll(std::uint32_t now_us) {
  if ((size_ != 0 || lost_) && now_us - last_us_ >= gap_us_) gap();
}

// --- TCP ----------------------------------------------------------------------------------------------

// MBAP header (V1.0b, 3.1.3): transaction (2), protocol 0 (2), length of unit and PDU (2), unit; then the
// PDU.
bool ModbusTcp::receive(const std::uint8_t* bytes, std::size_t size) {
  constexpr std::size_t header = 7;
  for (std::size_t i = 0; i < size && !broken_; ++i) {
    frame_[size_++] = bytes[i];
    if (size_ < header) continue;
    const std::size_t length = be16(frame_.data() + 4);  // unit and PDU
    if (length < 2 || length > 1 + map::pdu_bytes) {
      broken_ = true;
      break;
    }
    if (size_ < header - 1 + length) continue;
    size_ = 0;
    if (be16(frame_.data() + 2) != 0) continue;  // another protocol: "simply discarded" (V1.0b, 4.4.2.1)
    const std::uint8_t unit = frame_[6];
    if (unit != unit_ && unit != 0 && unit != 255) continue;
    std::uint8_t out[wire::modbus::tcp_bytes];
    const std::size_t n = server_->answer(frame_.data() + header, length - 1, out + header);
    std::memcpy(out, frame_.data(), 4);
    put16(out + 4, static_cast<std::uint32_t>(n + 1));
    out[6] = unit;
    if (transmit_.send != nullptr) transmit_.send(transmit_.user, out, header + n);
  }
  return !broken_;
}

}  // namespace firmware
}  // namespace flexcomp
