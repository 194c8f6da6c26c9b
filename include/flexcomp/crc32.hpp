// SPDX-License-Identifier: Apache-2.0
/// \file
/// CRC-32 of IEEE 802.3 (reflected, 0xEDB88320, init and final XOR all ones; "123456789" -> 0xCBF43926).
#ifndef FLEXCOMP_CRC32_HPP
#define FLEXCOMP_CRC32_HPP

#include <cstddef>
#include <cstdint>

namespace flexcomp {

/// Continues a CRC over more bytes; start with crc = 0. A table of 16 entries: 64 bytes of flash, two steps a
/// byte.
inline std::uint32_t crc32(const std::uint8_t* bytes, std::size_t size, std::uint32_t crc = 0) {
  static const std::uint32_t nibble[16] = {
      0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4, 0x4DB26158, 0x5005713C,
      0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C, 0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C};
  crc = ~crc;
  for (std::size_t i = 0; i < size; ++i) {
    crc ^= bytes[i];
    crc = (crc >> 4U) ^ nibble[crc & 15U];
    crc = (crc >> 4U) ^ nibble[crc & 15U];
  }
  return ~crc;
}

}  // namespace flexcomp

#endif
