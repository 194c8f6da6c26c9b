// SPDX-License-Identifier: Apache-2.0
// What the tests of the Modbus server share: a client of the PDU layer, and what a framing sends.
#pragma once

#include "firmware/bench.hpp"
#include "flexcomp_firmware/modbus.hpp"

namespace flexcomp::firmware::bench {

namespace map = wire::modbus;

inline Bytes be(std::initializer_list<unsigned> words) {
  Bytes out;
  for (const unsigned w : words) {
    out.push_back(static_cast<std::uint8_t>(w >> 8U));
    out.push_back(static_cast<std::uint8_t>(w));
  }
  return out;
}

inline Bytes join(std::initializer_list<Bytes> parts) {
  Bytes out;
  for (const Bytes& p : parts) out.insert(out.end(), p.begin(), p.end());
  return out;
}

/// A client of the PDU layer.
class Client {
 public:
  Client(Device& device, Origin origin) : server(device, origin) {}

  Bytes ask(const Bytes& request) {
    Bytes out(map::pdu_bytes);
    out.resize(server.answer(request.data(), request.size(), out.data()));
    return out;
  }
  Bytes read(unsigned address, unsigned quantity, std::uint8_t function = 3) {
    return ask(join({{function}, be({address, quantity})}));
  }
  Bytes write(unsigned address, const Bytes& data) {
    return ask(join({{0x10},
                     be({address, static_cast<unsigned>(data.size() / 2)}),
                     {static_cast<std::uint8_t>(data.size())},
                     data}));
  }
  Bytes run(wire::Command c, std::uint32_t argument = 0) {
    return write(map::argument, be({argument >> 16U, argument & 0xFFFFU, static_cast<unsigned>(c)}));
  }
  wire::Status status() {
    const Bytes r = read(map::status, map::status_registers);
    wire::Status s;
    wire::decode(r.data() + 2, wire::ByteOrder::big, s);
    return s;
  }
  Bytes stage(const Bytes& image) {
    Bytes r = run(wire::Command::begin, static_cast<std::uint32_t>(image.size()));
    for (std::size_t at = 0; at < image.size() && r[0] < 0x80; at += 242) {
      Bytes part(image.begin() + static_cast<std::ptrdiff_t>(at),
                 image.begin() + static_cast<std::ptrdiff_t>(std::min(image.size(), at + 242)));
      if (part.size() % 2 != 0) part.push_back(0);
      r = write(map::staging_offset,
                join({be({static_cast<unsigned>(at >> 16U), static_cast<unsigned>(at & 0xFFFFU)}), part}));
    }
    return r;
  }
  Bytes pull(std::size_t size) {
    Bytes out;
    while (out.size() < size) {
      const auto n = static_cast<unsigned>(std::min<std::size_t>(123, (size - out.size() + 1) / 2));
      const auto at = static_cast<unsigned>(out.size());
      const Bytes r = ask(join({{0x17},
                                be({map::reading_window, n, map::reading_offset, 2}),
                                {4},
                                be({at >> 16U, at & 0xFFFFU})}));
      if (r[0] != 0x17) return {};
      out.insert(out.end(), r.begin() + 2, r.end());
    }
    out.resize(size);
    return out;
  }
  ModbusServer server;
};

inline Bytes exception(unsigned function, unsigned code) {
  return {static_cast<std::uint8_t>(function | 0x80U), static_cast<std::uint8_t>(code)};
}

/// Collects what a framing sends.
struct Wire {
  Bytes bytes;
  unsigned answers = 0;
  Transmit transmit() {
    return {this, [](void* self, const std::uint8_t* b, std::size_t n) {
              auto& w = *static_cast<Wire*>(self);
              w.bytes.insert(w.bytes.end(), b, b + n);
              ++w.answers;
            }};
  }
};

inline Bytes rtu(std::uint8_t unit, const Bytes& pdu) {
  Bytes f = join({{unit}, pdu});
  const std::uint16_t crc = modbus_crc(f.data(), f.size());
  f.push_back(static_cast<std::uint8_t>(crc));
  f.push_back(static_cast<std::uint8_t>(crc >> 8U));
  return f;
}

}  // namespace flexcomp::firmware::bench
