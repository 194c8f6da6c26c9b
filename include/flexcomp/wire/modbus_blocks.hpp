// SPDX-License-Identifier: Apache-2.0
/// \file
/// The Modbus register map of modbus_map.hpp as a table: address, length, access and name of every block. The
/// firmware serves it, the host writes it to a file.
#ifndef FLEXCOMP_WIRE_MODBUS_BLOCKS_HPP
#define FLEXCOMP_WIRE_MODBUS_BLOCKS_HPP

#include <cstddef>
#include <cstdint>

#include "flexcomp/wire/certificate_record.hpp"
#include "flexcomp/wire/modbus_map.hpp"
#include "flexcomp/wire/robot_record.hpp"
#include "flexcomp/wire/unit_record.hpp"

namespace flexcomp {
namespace wire {
namespace modbus {

/// Blocks of registers; not on the wire.
enum class Block : std::uint8_t {
  capability,      ///< capability record
  status,          ///< status record
  argument,        ///< of the next command
  command,         ///< runs where it is written
  staging_offset,  ///< bytes
  staging_window,  ///< image bytes from that offset
  reading_offset,  ///< bytes
  reading_window,  ///< active image from that offset
  probe_request,   ///< probe request record
  probe_trigger,   ///< answers the request
  probe_response,  ///< probe response record
  probe_flags,     ///< of that response
  corrections,     ///< of the last control cycle, binary32
  robot,           ///< robot record
  certificate,     ///< certificate record
  unit,            ///< unit record
};

/// One block of the map.
struct BlockDescription {
  Block block;              ///< which one
  std::uint16_t address;    ///< of the PDU, from 0
  std::uint16_t registers;  ///< length
  bool readable;            ///< by functions 03, 04 and 23
  bool writable;            ///< by functions 06, 16 and 23
  const char* name;         ///< in the exported map
  const char* text;         ///< description in the exported map
};

/// All blocks, by address.
constexpr BlockDescription block_descriptions[] = {
    {Block::capability, capability, capability_registers, true, false, "capability",
     "what the controller is and holds"},
    {Block::status, status, status_registers, true, false, "status",
     "what the store and the control cycle are doing"},
    {Block::argument, argument, 2, true, true, "argument", "argument of the next command"},
    {Block::command, command, 1, true, true, "command", "writing it runs it; reads back the last one"},
    {Block::staging_offset, staging_offset, 2, true, true, "staging_offset",
     "where the staging window begins, bytes"},
    {Block::staging_window, staging_window, staging_window_registers, false, true, "staging_window",
     "image bytes from that offset, the first in the high byte"},
    {Block::reading_offset, reading_offset, 2, true, true, "reading_offset",
     "where the reading window begins, bytes"},
    {Block::reading_window, reading_window, reading_window_registers, true, false, "reading_window",
     "bytes of the active image from that offset"},
    {Block::probe_request, probe_request, probe_request_registers, true, true, "probe_request",
     "a joint command and its context"},
    {Block::probe_trigger, probe_trigger, 1, true, true, "probe_trigger",
     "1 answers the request, 2 its joint command with the robot's default context"},
    {Block::probe_response, probe_response, probe_response_registers, true, false, "probe_response",
     "the corrected command"},
    {Block::probe_flags, probe_flags, 1, true, false, "probe_flags",
     "all that holds of the probe response, as bits"},
    {Block::corrections, corrections, corrections_registers, true, false, "people",
     "corrections of the last control cycle, and the largest since the start"},
    {Block::robot, robot, robot_registers, true, false, "robot", "the nominal robot"},
    {Block::certificate, certificate, certificate_registers, true, false, "certificate",
     "what the active set can do at most, and what a step costs"},
    {Block::unit, unit, unit_registers, true, false, "unit", "which unit this is, and whom it trusts"},
};
/// Number of blocks.
constexpr std::size_t block_count = sizeof block_descriptions / sizeof block_descriptions[0];

}  // namespace modbus
}  // namespace wire
}  // namespace flexcomp

#endif
