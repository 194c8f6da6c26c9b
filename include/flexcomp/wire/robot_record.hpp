// SPDX-License-Identifier: Apache-2.0
/// \file
/// The nominal robot and name of a controller as one record, so that a set can be pushed and pulled without a
/// robot file. The hashes of the capability record confirm it.
///
///     robot record, 576 bytes
///       0 f64 x 5 x 6 links: theta_rad, d_m, a_m, alpha_rad, beta_rad of link 1, then of link 2 …
///     240 f64 x 2 x 6 limits of the joint readings: least, greatest of joint 1, … , rad
///     336 f64 x 3     gravity in F0, m/s^2
///     360 f64 x 3     origin of Ftool in F6, m
///     384 f64 x 4     orientation of Ftool, w x y z
///     416 f64         default payload, kg
///     424 f64 x 3     its centre of mass in F6, m
///     448 f64         reference temperature, deg C
///     456 u16         length of the name in bytes; 0 where the controller knows only its hash
///     458 118 bytes   name, UTF-8, filled up with zeros
///
/// Bytes and byte order are those of the other records (store_state.hpp).
///     Modbus   288 registers from 0x0500, read only
///     CANopen  0x2003 sub 0, DOMAIN, read only
/// A controller without it answers "no such address" or "no such object"; a host then asks for a robot file.
#ifndef FLEXCOMP_WIRE_ROBOT_RECORD_HPP
#define FLEXCOMP_WIRE_ROBOT_RECORD_HPP

#include <cstddef>
#include <cstdint>

#include "flexcomp/bytes.hpp"
#include "flexcomp/robot.hpp"
#include "flexcomp/wire/store_state.hpp"

namespace flexcomp {
namespace wire {

constexpr std::size_t robot_record_bytes = 576;  ///< size of the record
constexpr std::size_t robot_name_bytes = 118;    ///< longest name in it

namespace modbus {
constexpr std::uint16_t robot = 0x0500;                            ///< robot record, read only
constexpr std::uint16_t robot_registers = robot_record_bytes / 2;  ///< its length
}  // namespace modbus

namespace canopen {
constexpr std::uint16_t robot = 0x2003;  ///< robot record
}  // namespace canopen

namespace detail {

/// Visits the reals of the record in the order of the table above.
template <class Robot, class Visitor>
void visit_robot(Robot& r, Visitor&& v) {
  for (auto& link : r.links) {
    v(link.theta_rad), v(link.d_m), v(link.a_m), v(link.alpha_rad), v(link.beta_rad);
  }
  for (auto& limit : r.limits) v(limit.min_rad), v(limit.max_rad);
  for (auto& g : r.gravity_m_s2) v(g);
  for (auto& x : r.tool_xyz_m) v(x);
  for (auto& w : r.tool_wxyz) v(w);
  v(r.payload_kg);
  for (auto& x : r.payload_com_m) v(x);
  v(r.reference_temperature_c);
}

}  // namespace detail

/// Writes the record into `out` (robot_record_bytes). A name that is too long is left out.
inline void encode(const NominalRobot<joints>& robot, const char* name, std::size_t name_size,
                   ByteOrder order, std::uint8_t* out) {
  detail::Writer writer(out, order);
  detail::visit_robot(robot, [&writer](double value) { writer(bits_of(value)); });
  const std::size_t size = name_size <= robot_name_bytes ? name_size : 0;
  writer(static_cast<std::uint16_t>(size));
  for (std::size_t k = 0; k < size; ++k) writer(static_cast<std::uint8_t>(name[k]));
  writer.skip(robot_name_bytes - size);
}

/// Writes `size` bytes of the little-endian record into `out`, from `offset` on: the record in pieces, without memory for it.
inline void encode_part(const NominalRobot<joints>& robot, const char* name, std::size_t name_size,
                        std::size_t offset, std::uint8_t* out, std::size_t size) {
  std::size_t at = 0;
  const auto put = [&](std::uint8_t byte) {
    if (at >= offset && at - offset < size) out[at - offset] = byte;
    ++at;
  };
  detail::visit_robot(robot, [&](double value) {
    if (at + sizeof value <= offset || at >= offset + size) {
      at += sizeof value;
      return;
    }
    const std::uint64_t bits = bits_of(value);
    for (unsigned k = 0; k < 64; k += 8) put(static_cast<std::uint8_t>(bits >> k));
  });
  const std::size_t length = name_size <= robot_name_bytes ? name_size : 0;
  put(static_cast<std::uint8_t>(length));
  put(0);
  for (std::size_t k = 0; k < robot_name_bytes; ++k)
    put(k < length ? static_cast<std::uint8_t>(name[k]) : std::uint8_t{0});
}

/// Reads the record from `in` (robot_record_bytes), all but the name's hash; returns the length of the name,
/// whose bytes are written to `name` (robot_name_bytes). A length that cannot be is read as 0.
inline std::size_t decode(const std::uint8_t* in, ByteOrder order, NominalRobot<joints>& robot, char* name) {
  detail::Reader reader(in, order);
  detail::visit_robot(robot, [&reader](double& value) {
    std::uint64_t bits = 0;
    reader(bits);
    value = double_of(bits);
  });
  std::uint16_t size = 0;
  reader(size);
  if (size > robot_name_bytes) return 0;
  for (std::size_t k = 0; k < size; ++k) {
    std::uint8_t byte = 0;
    reader(byte);
    name[k] = static_cast<char>(byte);
  }
  return size;
}

}  // namespace wire
}  // namespace flexcomp

#endif
