// SPDX-License-Identifier: Apache-2.0
/// \file
/// Modbus requests from bytes of an input, for a line and for connections.
#pragma once

#include "whole_device.hpp"

namespace fuzz {

/// A PDU for this device: of the map (most of the time) or any bytes.
inline Bytes modbus_request(Device& device, Input& input) {
  // Blocks of modbus_map.hpp, their ends, and what lies between them.
  static constexpr std::uint16_t addresses[] = {
      0x0000, 0x003F, 0x0040, 0x006F, 0x0070, 0x00A0, 0x00A1, 0x00A2, 0x00A3, 0x0100,
      0x0101, 0x0102, 0x017A, 0x0200, 0x0201, 0x0202, 0x0300, 0x036B, 0x036C, 0x0380,
      0x03A3, 0x0400, 0x0500, 0x061F, 0x0700, 0x075B, 0xFFFF, 0x0800, 0x083F};
  const auto address = [&input] {
    const unsigned k = input.u8();
    return k == 255 ? unsigned{input.u16()}
                    : unsigned{addresses[k % (sizeof addresses / sizeof addresses[0])]};
  };
  const auto put16 = [](Output& out, unsigned v) { out.u8(v >> 8U & 0xFFU).u8(v & 0xFFU); };
  // Some bytes into staging.
  const auto to_staging = [&put16](const Bytes& image, std::size_t at) {
    const std::size_t size = std::min<std::size_t>(image.size() - at, 240);
    const unsigned count = static_cast<unsigned>(size + 1) / 2 + 2;
    Output request;
    request.u8(16).u8(1).u8(0);
    put16(request, count);
    request.u8(2 * count).u8(0).u8(0);
    put16(request, static_cast<unsigned>(at));
    request.add(Bytes(image.begin() + static_cast<std::ptrdiff_t>(at),
                      image.begin() + static_cast<std::ptrdiff_t>(at + size)));
    if (size % 2 != 0) request.u8(0);
    return request.out;
  };
  Output out;
  switch (input.u8() % 13) {
    case 0:
      return input.bytes(input.u8());
    case 1:
    case 2: {  // read
      out.u8(3U + (input.u8() & 1U));
      put16(out, address());
      put16(out, input.u8());
      return out.out;
    }
    case 3: {  // write one
      out.u8(6);
      put16(out, address());
      put16(out, input.u16());
      return out.out;
    }
    case 4: {  // write many
      const unsigned count = input.u8() % 124;
      out.u8(16);
      put16(out, address());
      put16(out, count);
      out.u8(2 * count);
      Bytes values = input.bytes(2 * std::size_t{count});
      values.resize(2 * std::size_t{count});
      return out.add(values).out;
    }
    case 5: {  // read and write
      const unsigned count = input.u8() % 122;
      out.u8(23);
      put16(out, address());
      put16(out, input.u8());
      put16(out, address());
      put16(out, count);
      out.u8(2 * count);
      Bytes values = input.bytes(2 * std::size_t{count});
      values.resize(2 * std::size_t{count});
      return out.add(values).out;
    }
    case 6:  // argument and command
      out.u8(16).u8(0).u8(0xA0).u8(0).u8(3).u8(6).u8(0).u8(0);
      put16(out, input.u16());
      put16(out, input.u8() % 12);
      return out.out;
    case 7:  // diagnostics
      out.u8(8);
      put16(out, input.u8() % 24);
      return out.add(input.bytes(input.u8() % 16)).out;
    case 8:  // identification
      return out.u8(43).u8(14).u8(input.u8() % 6).u8(input.u8() % 5).out;
    case 9:
      return out.u8(input.u8()).out;
    case 10: {  // probe and its answer
      out.u8(23);
      put16(out, 0x0380);
      put16(out, 36);
      put16(out, 0x0300);
      put16(out, 109);
      out.u8(218);
      Bytes values = input.bytes(input.u8() % 217);
      values.resize(216);
      out.add(values);
      put16(out, input.u8() % 4);
      return out.out;
    }
    case 11: {  // a part of a good image: command 6 of this list announces it
      const unsigned which = input.u8();
      const Bytes image = device.image(which, input.u8());
      return to_staging(image, std::min<std::size_t>(240 * std::size_t{input.u8()}, image.size()));
    }
    default: {  // a signed command, announced in the same way, with its 132 bytes
      const unsigned which = input.u8();
      Bytes bytes = device.signed_command(which & 0x0FU, input.u8(), (which >> 4U & 3U) % key_count);
      if ((which & 0x80U) != 0) bytes[input.u8() % bytes.size()] ^= input.u8();
      if ((which & 0x40U) != 0) mend_crc(bytes);
      return to_staging(bytes, 0);
    }
  }
}

/// What a master sends, in the form that modbus_request() reads: `image` announced and staged, then `command`.
/// Each request begins with `before`.
inline Bytes modbus_push(const Bytes& before, unsigned image, unsigned sequence, unsigned command,
                         bool is_signed = false) {
  const std::size_t size = good_image(image, sequence).size() + (is_signed ? 88 + 36 : 0);
  Output out;
  out.add(before).u8(6).u16(static_cast<unsigned>(size)).u8(1);
  for (unsigned k = 0; 240 * std::size_t{k} < size; ++k) out.add(before).u8(11).u8(image).u8(sequence).u8(k);
  out.add(before).u8(6).u16(0).u8(command);
  return out.out;
}

/// Operations that the targets of both lines have under one number.
constexpr unsigned settle = 5, steps = 6, power = 10;

/// A push, and then each command once, asked for by requests that begin with `asked`; the power goes after it.
/// On a device that trusts a key: a set, then a signed command.
inline void add_signed_seeds(const Bytes& before, std::vector<Bytes>& all) {
  for (unsigned command = 5; command < 10; ++command) {
    const Bytes push = modbus_push(before, 3, 20, command == 5 ? 4 : 3, true);
    Output out;
    out.add(octets(33, steps, 3)).add(push).add(octets(settle, steps, 20));
    out.add(before).add(octets(6, 132, 0, 1)).add(before).add(octets(12, command, 40));
    out.add(before).add(octets(6, 0, 0, 2, settle)).add(before).add(octets(6, 0, 0, command, settle, power));
    all.push_back(out.add(before).add(octets(1, 27, 64)).out);
  }
}

inline void add_command_seeds(const Bytes& before, const Bytes& asked, std::vector<Bytes>& all) {
  for (unsigned command = 2; command < 9; ++command) {
    Output out;
    out.u8(command % 3)
        .u8(steps)
        .u8(1)
        .add(modbus_push(before, command % image_count, 9, command < 5 ? command : 3));
    out.u8(settle).u8(steps).u8(20).add(asked).u8(6).u16(0).u8(command).u8(settle).u8(power);
    all.push_back(out.out);
  }
}

/// The kinds of requests of modbus_request(), one each.
inline std::vector<Bytes> modbus_samples() {
  std::vector<Bytes> all;
  for (unsigned k = 0; k < 29; ++k) all.push_back(Output().u8(1).u8(k).u8(k).u8(k % 3 == 0 ? 64 : 2).out);
  for (unsigned k = 0; k < 27; k += 2) all.push_back(Output().u8(3).u8(k).u16(k).out);
  for (unsigned k = 5; k < 22; k += 2) all.push_back(Output().u8(4).u8(2).u8(k).u32(k).out);
  // Whole blocks: corrections, certificate, robot, unit, the staging window, what is not there.
  for (const unsigned k : {11U, 13U, 15U, 21U, 22U, 24U, 27U})
    all.push_back(octets(1, k, k, k == 21 ? 14 : k == 27 ? 64 : k == 22 ? 20 : 92));
  for (unsigned k = 0; k < 24; ++k) all.push_back(octets(7, k, 2, 0, 0));
  for (const unsigned data : {0U, 1U, 0xFFU}) all.push_back(octets(7, 1, 2, data, 0));
  for (const unsigned sub : {4U, 11U, 1U}) all.push_back(octets(7, sub, 2, 0, 0));
  all.push_back(octets(7, 14, 3, 0, 0, 0));
  // Sizes that do not fit, as the bytes come.
  all.push_back(octets(0, 5, 16, 0, 160, 0, 3));
  all.push_back(octets(0, 6, 16, 0, 160, 0, 0, 0));
  all.push_back(octets(0, 4, 3, 0, 0, 0));
  all.push_back(octets(0, 5, 3, 0, 0, 0, 0));
  all.push_back(octets(0, 9, 23, 0, 0, 0, 1, 0, 160, 0, 1));
  all.push_back(octets(0, 12, 23, 0, 0, 0, 0, 0, 160, 0, 1, 2, 0, 0));
  all.push_back(octets(0, 12, 23, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0, 0));
  all.push_back(octets(0, 5, 43, 14, 9, 0, 0));
  all.push_back(octets(0, 4, 43, 13, 1, 0));
  all.push_back(octets(0, 3, 8, 0, 0));
  all.push_back(octets(1, 7, 0, 1));
  all.push_back(octets(1, 6, 0, 1));
  all.push_back(octets(1, 9, 0, 2));
  for (unsigned k = 0; k < 6; ++k) all.push_back(Output().u8(8).u8(k).u8(k).out);
  all.push_back(Output().u8(5).u8(2).u8(14).u8(123).u8(13).u32(0).out);
  all.push_back(Output().u8(9).u8(17).out);
  all.push_back(Output().u8(9).u8(11).out);
  all.push_back(Output().u8(10).u8(8).u32(0).u32(0x3FD00000).u8(1).out);
  all.push_back(Output().u8(10).u8(0).u8(2).out);
  all.push_back(Output().u8(0).u8(3).u8(1).u8(2).u8(3).out);
  return all;
}

}  // namespace fuzz
