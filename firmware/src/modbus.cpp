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
constexpr std::uint8_t write_multiple_registers = 0x10;
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
};

/// The map without names and texts, made at compile time so that they take no flash.
constexpr std::array<BlockPlace, map::block_count> served() {
  std::array<BlockPlace, map::block_count> out{};
  for (std::size_t k = 0; k < map::block_count; ++k) {
    const map::BlockDescription& d = map::block_descriptions[k];
    out[k] = BlockPlace{d.block, d.address, d.registers, d.readable, d.writable};
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

/// True where all registers of a range exist and may be read (or written).
bool range_exists(std::uint32_t address, std::uint32_t quantity, bool to_write) {
  if (address + quantity > 0x10000U) return false;
  while (quantity != 0) {
    const BlockPlace* b = block_at(address);
    if (b == nullptr || !(to_write ? b->writable : b->readable)) return false;
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
      wire::encode(device_.probe(request), wire::ByteOrder::big, probe_response_.data());
      return Exception::none;
    }
    case Block::capability:
    case Block::status:
    case Block::reading_window:
    case Block::probe_response:
    case Block::corrections:
    case Block::robot:
    case Block::certificate:
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

std::size_t ModbusServer::answer(const std::uint8_t* request, std::size_t size, std::uint8_t* out) {
  if (size == 0) return 0;
  const std::uint8_t function = request[0];
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
      if (!range_exists(address, quantity, false)) {
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
      if (!range_exists(address, 1, true)) return refuse(function, Exception::illegal_data_address, out);
      const Exception e = write(address, 1, request + 3);
      if (e != Exception::none) return refuse(function, e, out);
      std::memcpy(out, request, 5);
      return 5;
    }
    case diagnostics: {
      // 6.8: 08, sub-function 00 (Return Query Data), data -> the same. The other sub-functions are counters
      // of a serial line, which this server does not have.
      if (size < 3) return refuse(function, Exception::illegal_data_value, out);
      if (be16(request + 1) != 0) return refuse(function, Exception::illegal_function, out);
      if (size > map::pdu_bytes) return refuse(function, Exception::illegal_data_value, out);
      std::memmove(out, request, size);
      return size;
    }
    case write_multiple_registers: {
      // 6.12: 10, address (2), quantity (2), byte count, registers -> 10, address, quantity
      if (size < 6) return refuse(function, Exception::illegal_data_value, out);
      const std::uint32_t address = be16(request + 1);
      const std::uint32_t quantity = be16(request + 3);
      if (quantity < 1 || quantity > map::most_written) {
        return refuse(function, Exception::illegal_data_value, out);
      }
      if (!range_exists(address, quantity, true)) {
        return refuse(function, Exception::illegal_data_address, out);
      }
      if (request[5] != 2 * quantity || size != 6 + 2 * static_cast<std::size_t>(quantity)) {
        return refuse(function, Exception::illegal_data_value, out);
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
      if (reads < 1 || reads > map::most_read || writes < 1 || writes > map::most_written_by_23) {
        return refuse(function, Exception::illegal_data_value, out);
      }
      if (!range_exists(from, reads, false) || !range_exists(to, writes, true)) {
        return refuse(function, Exception::illegal_data_address, out);
      }
      if (request[9] != 2 * writes || size != 10 + 2 * static_cast<std::size_t>(writes)) {
        return refuse(function, Exception::illegal_data_value, out);
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

/// Length of the request frame whose first bytes are in frame_, 0 where it is not known (yet).
std::size_t ModbusRtu::expected() const {
  if (size_ < 2) return 0;
  switch (frame_[1]) {
    case 0x01:
    case 0x02:
    case read_holding_registers:
    case read_input_registers:
    case 0x05:
    case write_single_register:
    case diagnostics:
      return 8;
    case 0x07:
    case 0x0B:
    case 0x0C:
    case 0x11:
      return 4;
    case 0x0F:
    case write_multiple_registers:
      return size_ < 7 ? 0 : 9 + static_cast<std::size_t>(frame_[6]);
    case 0x16:
      return 10;
    case read_write_registers:
      return size_ < 11 ? 0 : 13 + static_cast<std::size_t>(frame_[10]);
    case encapsulated_interface:
      return size_ < 3 || frame_[2] != read_device_identification ? 0 : 7;
    default:
      return 0;
  }
}

/// Answers the frame in frame_, whose CRC is right.
void ModbusRtu::take_frame() {
  const std::uint8_t unit = frame_[0];
  const std::size_t size = size_;
  size_ = 0;
  crc_ = 0xFFFF;
  if (unit != unit_ && unit != 0) return;
  std::uint8_t out[wire::modbus::rtu_bytes];
  const std::size_t n = server_.answer(frame_.data() + 1, size - 3, out + 1);
  if (unit == 0 || n == 0 || transmit_.send == nullptr) return;  // a broadcast is carried out, never answered
  out[0] = unit_;
  const std::uint16_t crc = modbus_crc(out, n + 1);
  out[n + 1] = static_cast<std::uint8_t>(crc);
  out[n + 2] = static_cast<std::uint8_t>(crc >> 8U);
  transmit_.send(transmit_.user, out, n + 3);
}

void ModbusRtu::gap() {
  if (!lost_ && size_ >= 4 && crc_ == 0) {
    take_frame();  // an unknown function code: answered by exception 01
  }
  size_ = 0;
  crc_ = 0xFFFF;
  lost_ = false;
}

void ModbusRtu::receive(const std::uint8_t* bytes, std::size_t size, std::uint32_t now_us) {
  poll(now_us);
  if (size != 0) last_us_ = now_us;
  for (std::size_t i = 0; i < size; ++i) {
    if (lost_) continue;
    if (size_ == frame_.size()) {
      lost_ = true;
      continue;
    }
    frame_[size_++] = bytes[i];
    crc_ = modbus_crc(bytes + i, 1, crc_);
    if (frame_[0] == unit_ || frame_[0] == 0) {
      const std::size_t n = expected();
      if (n == 0 || size_ < n) continue;
      if (n > frame_.size() || crc_ != 0) {
        lost_ = true;
      } else {
        take_frame();
      }
    } else if (size_ >= 4 && crc_ == 0) {
      take_frame();  // request or answer of another unit
    }
  }
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
    if (be16(frame_.data() + 2) != 0 || length < 2 || length > 1 + map::pdu_bytes) {
      broken_ = true;
      break;
    }
    if (size_ < header - 1 + length) continue;
    size_ = 0;
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
