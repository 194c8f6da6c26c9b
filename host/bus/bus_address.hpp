// SPDX-License-Identifier: Apache-2.0
/// \file
/// Addresses of controllers: bus, interface or host, node or unit.
///
///     can:IFACE[:NODE[:CHANNEL]]                NODE 1 … 127, default 1; CHANNEL: own, or REQUEST-ANSWER in hex
///     modbus-tcp:HOST[:PORT][:UNIT]             PORT default 502, UNIT 0 … 255, default 255 (the device itself)
///     modbus-rtu:DEVICE[:BAUD[:PARITY]][:UNIT]  BAUD default 19200, PARITY N, E or O, default E, UNIT 1 … 247, default 1
///
/// CHANNEL is the SDO server 1201h in place of 1200h, by its COB-IDs; own stands for flexcomp's choice, 67Fh + node and
/// 6AFh + node, for nodes up to 48 (flexcomp/wire/canopen_objects.hpp).
///
/// The defaults are those of the standards (Modbus messaging on TCP/IP 1.0b, 4.4.1; serial line 1.02, 2.5.1). An IPv6
/// address stands in square brackets. A serial line's fields are read from the right, so a DEVICE may contain
/// colons; a single number of at most 247 is a UNIT, a larger one a BAUD.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

namespace flexcomp::host {

struct CanAddress {
  std::string interface;
  std::uint8_t node = 1;
  std::uint16_t own_request = 0;  ///< COB-ID of requests to 1201h; 0: 1200h is used
  std::uint16_t own_answer = 0;   ///< COB-ID of its answers

  std::uint16_t sdo_request() const;  ///< COB-ID of requests
  std::uint16_t sdo_answer() const;   ///< COB-ID of answers
};

struct ModbusTcpAddress {
  std::string host;
  std::uint16_t port = 502;
  std::uint8_t unit = 255;
};

enum class Parity : char { none = 'N', even = 'E', odd = 'O' };

struct ModbusRtuAddress {
  std::string device;
  std::uint32_t baud = 19200;
  Parity parity = Parity::even;
  std::uint8_t unit = 1;
};

struct BusAddress {
  std::variant<CanAddress, ModbusTcpAddress, ModbusRtuAddress> at;

  /// The address with all defaults filled in: can:vcan0:1.
  std::string text() const;
};

/// Parses an address of the grammar above.
/// \throws std::invalid_argument  naming the wrong field and the expected form
BusAddress parse_bus_address(std::string_view text);

}  // namespace flexcomp::host
