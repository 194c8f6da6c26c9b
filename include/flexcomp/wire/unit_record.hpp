// SPDX-License-Identifier: Apache-2.0
/// \file
/// Which unit of a robot's type a controller belongs to, and whom it trusts, as one record.
///
///     unit record, 128 bytes
///       0 SHA-256 of the serial number, 32 bytes; zeros: it has none
///      32 u64 highest counter of a signature that was accepted, 0: none
///      40 u16 keys that are trusted; 0: sets need no signature, rollback and restore_defaults an unlock
///      42 u16 length of the serial number in bytes; 0 where there is none, or too long a one
///      44 44 bytes: serial number, UTF-8, filled up with zeros
///      88 ids of the first four keys that are trusted, 8 bytes each (signature.hpp); zeros: none
///     120 8 bytes 0, reserved
///
/// Bytes and byte order are those of the other records (store_state.hpp).
///     Modbus   64 registers from 0x0800, read only
///     CANopen  0x2006 sub 0, DOMAIN, read only
/// A controller whose capability record lacks capability_flag::unit has none of this.
#ifndef FLEXCOMP_WIRE_UNIT_RECORD_HPP
#define FLEXCOMP_WIRE_UNIT_RECORD_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/robot.hpp"
#include "flexcomp/wire/store_state.hpp"

namespace flexcomp {
namespace wire {

constexpr std::size_t unit_record_bytes = 128;  ///< size of the record
constexpr std::size_t serial_bytes = 44;        ///< longest serial number in it
constexpr std::size_t listed_keys = 4;          ///< keys whose ids are in it, at most

/// Unit record.
struct UnitRecord {
  Sha256Digest unit_hash{};                                        ///< of the serial number; zeros: none
  std::uint64_t counter = 0;                                       ///< highest one that was accepted
  std::uint16_t keys = 0;                                          ///< that are trusted
  std::uint16_t serial_size = 0;                                   ///< of what follows, bytes
  std::array<std::uint8_t, serial_bytes> serial{};                 ///< UTF-8
  std::array<std::array<std::uint8_t, 8>, listed_keys> key_ids{};  ///< of the first ones
};

namespace modbus {
constexpr std::uint16_t unit = 0x0800;                           ///< unit record, read only
constexpr std::uint16_t unit_registers = unit_record_bytes / 2;  ///< its length
}  // namespace modbus

namespace canopen {
constexpr std::uint16_t unit = 0x2006;  ///< unit record
}  // namespace canopen

namespace detail {

template <class Record, class Visitor>
void visit_unit(Record& r, Visitor&& v) {
  v.bytes(r.unit_hash.data(), r.unit_hash.size());
  v(r.counter), v(r.keys), v(r.serial_size);
  v.bytes(r.serial.data(), r.serial.size());
  for (auto& id : r.key_ids) v.bytes(id.data(), id.size());
  v.skip(8);
}

}  // namespace detail

/// Writes a record into `out`, of at least unit_record_bytes.
inline void encode(const UnitRecord& r, ByteOrder order, std::uint8_t* out) {
  detail::visit_unit(r, detail::Writer(out, order));
}
/// Reads a record from `in`, of at least unit_record_bytes. A length that cannot be is read as 0.
inline void decode(const std::uint8_t* in, ByteOrder order, UnitRecord& r) {
  detail::visit_unit(r, detail::Reader(in, order));
  if (r.serial_size > serial_bytes) r.serial_size = 0;
}

}  // namespace wire
}  // namespace flexcomp

#endif
