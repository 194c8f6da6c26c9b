// SPDX-License-Identifier: Apache-2.0
/// \file
/// Modbus register map (Modbus Application Protocol V1.1b3). Addresses are those of the PDU, from 0; a tool
/// that counts from 1 (or from 40001) adds one. The records and commands are described in store_state.hpp.
///
///     address  registers  access  what
///     0x0000        64    r       capability record
///     0x0040        48    r       status record
///     0x00A0         2    rw      argument of the next command, u32, high word first
///     0x00A2         1    rw      command (wire::Command): writing it runs it; reads back the last one
///     0x0100         2    rw      staging offset in bytes, u32, high word first
///     0x0102       121    w       staging window: image bytes from that offset
///     0x0200         2    rw      reading offset in bytes, u32, high word first
///     0x0202       123    r       reading window: bytes of the active image from that offset
///     0x0300       108    rw      probe request record
///     0x036C         1    rw      probe trigger: writing 1 answers the request, 2 answers its joint command
///                                 with the robot's default context
///     0x0380        36    r       probe response record
///     0x03A4         1    r       flags of that response (flexcomp::step_flag)
///     0x0400        14    r       corrections, binary32 "ABCD": correction of joints 1 … 6 in the
///                                 last control cycle, then the largest of any joint since the start (deg)
///     0x0500       288    r       robot record (robot_record.hpp)
///     0x0700        92    r       certificate record of the active set (certificate_record.hpp)
///     0x0800        64    r       unit record (unit_record.hpp)
///
/// - All of it is read by function 03 and by 04 alike, written by 06, 16 and 23. What lies between the blocks
///   does not exist (exception 02), a write to what is only read is exception 02 as well.
/// - A register of a window holds two bytes of the image, the first one in its high byte: a dump of the PDU
///   shows the image in order, so word order never matters. Register k of a window is byte offset + 2 k.
/// - Staging: the bytes may be sent again (a lost answer), but leave no gap and never exceed the announced
///   length; of an odd length the last low byte is padding. Offset and bytes fit in one request of function
///   16 (123 registers, 242 bytes of the image). The offset does not advance by itself.
/// - Reading beyond the active image is exception 02. One request of function 23 writes the offset and reads
///   up to 123 registers. The set may change between two requests: compare the status before and after.
/// - Argument and command in one request of function 16 (three registers from 0x00A0) run the command.
/// - One request of function 23 writes probe request and trigger (109 registers) and reads the response, with its flags (37) or without (36).
/// - An application refuses with exception 04, or 06 where it is busy; `answer`, `refusal` and `detail` in
///   the status record say why. Two TCP connections have each their own offsets, argument and probe.
/// - TCP: units 0, 255 and the configured one are this device, other units get no answer. RTU: unit 0 is
///   broadcast and never answered; carried out are writes (06, 16) to the reading offset and to the probe. Argument,
///   command and staging are not written by a broadcast.
/// - Function 17 tells server ID, whether a set is active, and the version; 43/14 the identification; 08, on a serial
///   line, counters, and 11 its event counter (docs/modbus.md).
#ifndef FLEXCOMP_WIRE_MODBUS_MAP_HPP
#define FLEXCOMP_WIRE_MODBUS_MAP_HPP

#include <cstdint>

#include "flexcomp/wire/store_state.hpp"

namespace flexcomp {
namespace wire {
namespace modbus {

constexpr std::uint16_t capability = 0x0000;                          ///< capability record, read only
constexpr std::uint16_t capability_registers = capability_bytes / 2;  ///< its length
constexpr std::uint16_t status = 0x0040;                              ///< status record, read only
constexpr std::uint16_t status_registers = status_bytes / 2;          ///< its length
constexpr std::uint16_t argument = 0x00A0;                            ///< argument of the next command, u32
constexpr std::uint16_t command = 0x00A2;                             ///< command; writing it runs it
constexpr std::uint16_t staging_offset = 0x0100;         ///< offset of the staging window, u32, bytes
constexpr std::uint16_t staging_window = 0x0102;         ///< image bytes, write only
constexpr std::uint16_t staging_window_registers = 121;  ///< its length
constexpr std::uint16_t reading_offset = 0x0200;         ///< offset of the reading window, u32, bytes
constexpr std::uint16_t reading_window = 0x0202;         ///< bytes of the active image, read only
constexpr std::uint16_t reading_window_registers = 123;  ///< its length
constexpr std::uint16_t probe_request = 0x0300;          ///< probe request record
constexpr std::uint16_t probe_request_registers = probe_request_bytes / 2;  ///< its length
constexpr std::uint16_t probe_trigger = 0x036C;   ///< trigger_request or trigger_default_context
constexpr std::uint16_t probe_response = 0x0380;  ///< probe response record, read only
constexpr std::uint16_t probe_response_registers = probe_response_bytes / 2;  ///< its length
constexpr std::uint16_t probe_flags = 0x03A4;        ///< of the probe response, read only
constexpr std::uint16_t corrections = 0x0400;        ///< corrections of the last control cycle, read only
constexpr std::uint16_t corrections_registers = 14;  ///< its length

constexpr std::uint16_t trigger_request = 1;          ///< answers the whole probe request
constexpr std::uint16_t trigger_default_context = 2;  ///< answers its q with the robot's default context

/// Registers read by one request of function 03, 04 or 23 (6.3, 6.4, 6.17).
constexpr std::uint16_t most_read = 125;
constexpr std::uint16_t most_written = 123;        ///< registers written by one request of function 16 (6.12)
constexpr std::uint16_t most_written_by_23 = 121;  ///< registers written by one request of function 23 (6.17)
constexpr std::size_t pdu_bytes = 253;             ///< largest PDU (4.1)
constexpr std::size_t rtu_bytes = 256;             ///< largest RTU frame: unit, PDU, CRC-16 (4.1)
constexpr std::size_t tcp_bytes = 260;             ///< largest TCP frame: MBAP header, PDU (4.1)
constexpr std::uint16_t default_tcp_port = 502;    ///< registered with IANA
constexpr std::uint8_t server_id = 0xF1;           ///< of function 17 (6.13): FLX1

/// Exception codes, V1.1b3 clause 7.
enum class Exception : std::uint8_t {
  none = 0,                   ///< answered without exception; not on the wire
  illegal_function = 1,       ///< 01: function code not known
  illegal_data_address = 2,   ///< 02: registers that do not exist
  illegal_data_value = 3,     ///< 03: quantity or length is wrong
  server_device_failure = 4,  ///< 04: refused; the status record says why
  server_device_busy = 6,     ///< 06: busy
};

}  // namespace modbus
}  // namespace wire
}  // namespace flexcomp

#endif
