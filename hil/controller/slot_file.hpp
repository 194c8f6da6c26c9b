// SPDX-License-Identifier: Apache-2.0
/// \file
/// Non-volatile memory as a file: two consecutive slots, erased bytes 0xFF, every write synced to disk. Each byte is
/// written once between two erases, as on flash.
#pragma once

#include <cstdint>
#include <string>

#include "bus/descriptor.hpp"
#include "flexcomp_firmware/store.hpp"

namespace flexcomp::hil {

class SlotFile {
 public:
  /// Opens or creates the file and locks it against a second controller.
  /// \throws host::InputError  it cannot be opened, is in use, or is not of the size that this controller writes
  explicit SlotFile(const std::string& path);

  firmware::Storage hooks();

 private:
  static firmware::StorageResult read(void* self, unsigned slot, std::uint32_t offset, std::uint8_t* to,
                                      std::uint32_t size);
  static firmware::StorageResult erase(void* self, unsigned slot);
  static firmware::StorageResult write(void* self, unsigned slot, std::uint32_t offset,
                                       const std::uint8_t* from, std::uint32_t size);
  bool put(const std::uint8_t* from, std::uint32_t size, std::uint64_t offset);

  std::string path_;
  host::Descriptor file_;
};

}  // namespace flexcomp::hil
