// SPDX-License-Identifier: Apache-2.0
/// \file
/// Non-volatile memory of a CANopen node's communication parameters as a small file. It is replaced as a whole, so that after a
/// power failure it holds what it held before or what was saved.
#pragma once

#include <string>
#include <utility>

#include "flexcomp_firmware/canopen.hpp"

namespace flexcomp::hil {

class RecordFile {
 public:
  explicit RecordFile(std::string path) : path_(std::move(path)) {}
  firmware::CanMemory hooks() { return {this, load, save}; }

 private:
  static int load(void* self, std::uint8_t* to);
  static int save(void* self, const std::uint8_t* from);

  std::string path_;
};

}  // namespace flexcomp::hil
