// SPDX-License-Identifier: Apache-2.0
/// \file
/// The certificate of the active set (flexcomp/admission.hpp) as one record: what the set can do at most, and what a
/// step with it costs.
///
///     certificate record, 184 bytes
///       0 f64 x 6 deflection of joints 1 … 6, at most, rad
///      48 f64 x 6 its slope over the readings, at most, rad per rad
///      96 f64     deflection of links, base and tool together, lengths divided by the reach, rad
///     104 f64     its slope
///     112 f64     change by the payload's mass, at most, rad/kg
///     120 f64     by the external force, rad/N
///     128 f64     by the payload's centre of mass, rad/m
///     136 f64     by the temperature, rad/K
///     144 f64     size of the whole set at the tool, position, m
///     152 f64     the same, orientation, rad
///     160 f64     reach of the arm with its tool, m
///     168 u32     instructions of one step, at most, on a Cortex-M7
///     172 u32     instructions that a set may have here
///     176 u32     sequence of the set, 0 for none: then all before is 0 but the limit
///     180 u32     0, reserved
///
/// Bytes and byte order are those of the other records (store_state.hpp).
///     Modbus   92 registers from 0x0700, read only
///     CANopen  0x2004 sub 0, DOMAIN, read only
///              0x2005 sub 1 … 9, single values for people and PLCs
#ifndef FLEXCOMP_WIRE_CERTIFICATE_RECORD_HPP
#define FLEXCOMP_WIRE_CERTIFICATE_RECORD_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/wire/store_state.hpp"

namespace flexcomp {
namespace wire {

/// Certificate record; reals as binary64 bits.
struct CertificateRecord {
  std::array<std::uint64_t, joints> deflection_rad{};  ///< of each joint
  std::array<std::uint64_t, joints> slope{};           ///< of each joint
  std::uint64_t off_joint_rad = 0;                     ///< of what is off the joints
  std::uint64_t off_joint_slope = 0;                   ///< of what is off the joints
  std::uint64_t rad_per_kg = 0;                        ///< by the payload's mass
  std::uint64_t rad_per_n = 0;                         ///< by the external force
  std::uint64_t rad_per_m = 0;                         ///< by the payload's centre of mass
  std::uint64_t rad_per_k = 0;                         ///< by the temperature
  std::uint64_t position_m = 0;                        ///< size of the set at the tool
  std::uint64_t orientation_rad = 0;                   ///< size of the set at the tool
  std::uint64_t reach_m = 0;                           ///< of the arm
  std::uint32_t instructions = 0;                      ///< of one step
  std::uint32_t most_instructions = 0;                 ///< that are allowed
  std::uint32_t sequence = 0;                          ///< of the set, 0: none
};
constexpr std::size_t certificate_bytes = 184;  ///< size of the record

namespace modbus {
constexpr std::uint16_t certificate = 0x0700;                           ///< certificate record, read only
constexpr std::uint16_t certificate_registers = certificate_bytes / 2;  ///< its length
}  // namespace modbus

namespace canopen {
constexpr std::uint16_t certificate = 0x2004;          ///< certificate record
constexpr std::uint16_t certificate_summary = 0x2005;  ///< certificate as single values
}  // namespace canopen

namespace detail {

template <class Record, class Visitor>
void visit_certificate(Record& r, Visitor&& v) {
  for (auto& x : r.deflection_rad) v(x);
  for (auto& x : r.slope) v(x);
  v(r.off_joint_rad), v(r.off_joint_slope), v(r.rad_per_kg), v(r.rad_per_n), v(r.rad_per_m), v(r.rad_per_k);
  v(r.position_m), v(r.orientation_rad), v(r.reach_m);
  v(r.instructions), v(r.most_instructions), v(r.sequence), v.skip(4);
}

}  // namespace detail

/// Writes a record into `out`, of at least certificate_bytes.
inline void encode(const CertificateRecord& r, ByteOrder order, std::uint8_t* out) {
  detail::visit_certificate(r, detail::Writer(out, order));
}
/// Reads a record from `in`, of at least certificate_bytes.
inline void decode(const std::uint8_t* in, ByteOrder order, CertificateRecord& r) {
  detail::visit_certificate(r, detail::Reader(in, order));
}

}  // namespace wire
}  // namespace flexcomp

#endif
