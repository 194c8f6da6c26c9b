// SPDX-License-Identifier: Apache-2.0
/// \file
/// What a controller offers on its buses as files for other programs: the electronic data sheet of the CANopen node and the
/// Modbus register map. Both are written from the tables that the firmware serves.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "json.hpp"

namespace flexcomp::host {

/// CiA 306-1, EDS version 4.0. `file` is the name it is going to have. Revision and dates are those of the contents, not of
/// the export: the same version gives the same bytes.
std::string electronic_data_sheet(const std::string& file);

/// One number (or run of bytes) of the register map.
struct Register {
  std::uint16_t address = 0;
  std::uint16_t registers = 0;
  bool readable = false;
  bool writable = false;
  std::string block;
  std::string name;
  std::string type;  ///< u16, u32, f32, f64 (most significant register first), bytes
  std::string unit;
  std::string text;
};

/// The map field by field, in the order of addresses, without gaps within a block.
std::vector<Register> register_map();

std::string register_map_csv();
std::string register_map_markdown();
Json register_map_json();

}  // namespace flexcomp::host
