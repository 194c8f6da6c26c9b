// SPDX-License-Identifier: Apache-2.0
/// \file
/// The Modbus register map as a table: every block with its place, access and name, the one home of what modbus_map.hpp
/// explains. The firmware serves it, the host writes it as a file.
#ifndef FLEXCOMP_WIRE_MODBUS_BLOCKS_HPP
#define FLEXCOMP_WIRE_MODBUS_BLOCKS_HPP

#include <cstddef>
#include <cstdint>

#include "flexcomp/wire/modbus_map.hpp"
#include "flexcomp/wire/robot_record.hpp"

namespace flexcomp {
namespace wire {
namespace modbus {

enum class Block : std::uint8_t {
  capability,
  status,
  argument,
  command,
  staging_offset,
  staging_window,
  reading_offset,
  reading_window,
  probe_request,
  probe_trigger,
  probe_response,
  people,
  robot,
};

struct BlockDescription {
  Block block;
  std::uint16_t address;
  std::uint16_t registers;
  bool readable;
  bool writable;
  const char* name;
  const char* text;  ///< for people
};

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
    {Block::people, people, people_registers, true, false, "people",
     "corrections of the last control cycle, and the largest since the start"},
    {Block::robot, robot, robot_registers, true, false, "robot", "the nominal robot"},
};
constexpr std::size_t block_count = sizeof block_descriptions / sizeof block_descriptions[0];

}  // namespace modbus
}  // namespace wire
}  // namespace flexcomp

#endif
