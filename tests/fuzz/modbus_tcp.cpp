// SPDX-License-Identifier: Apache-2.0
// Streams of two Modbus TCP connections to a whole device, in any portions, with resets, polls, cycles and power failures between
// them. Input: the controller's start, then operations; bit 7 of an operation is the connection.
#include "modbus_requests.hpp"

namespace fuzz::modbus_tcp_target {
namespace {

constexpr unsigned request = 0, raw = 2, portions = 3, store_poll = 4, close = 7, open = 8, storage = 9,
                   operations = 11;

/// A frame around a PDU whose header may be wrong by a byte.
Bytes frame_of(Device& device, Input& input) {
  const unsigned wrong = input.u8();
  const unsigned byte = input.u8();
  const Bytes pdu = modbus_request(device, input);
  const unsigned length = static_cast<unsigned>(pdu.size()) + 1;
  Bytes frame =
      Output().u16(0x0201).u16(0).u8(length >> 8U & 0xFFU).u8(length & 0xFFU).u8(unit_id).add(pdu).out;
  if (wrong < 7) frame[wrong] = static_cast<std::uint8_t>(byte);
  return frame;
}

void operate(Device& device, Input& input, std::array<bool, Device::connections>& in_step) {
  const unsigned operation = input.u8();
  const std::size_t k = operation >> 7U;
  switch ((operation & 0x7FU) % operations) {
    case request:
    case request + 1: {
      const Bytes pdu = modbus_request(device, input);
      // Where the stream is in step there is an answer, and it is to this request.
      if (in_step[k]) {
        device.ask(k, pdu);
      } else {
        device.tcp(
            k,
            Output().u16(1).u16(0).u8(0).u8(static_cast<unsigned>(pdu.size()) + 1).u8(unit_id).add(pdu).out);
      }
      break;
    }
    case raw:
      in_step[k] = false;
      device.tcp(k, input.bytes(input.u8()));
      break;
    case portions: {
      in_step[k] = false;
      const unsigned at = input.u8();
      const Bytes frame = frame_of(device, input);
      const auto cut = frame.begin() + static_cast<std::ptrdiff_t>(at % frame.size());
      device.tcp(k, Bytes(frame.begin(), cut));
      device.tcp(k, Bytes(cut, frame.end()));
      break;
    }
    case store_poll:
      device.poll(input.u16());
      break;
    case settle:
      device.settle();
      break;
    case steps:
      device.ordinary_steps(1 + input.u8() % 24);
      break;
    case close:
      device.tcp_reset(k);
      in_step[k] = true;
      break;
    case open:
      device.tcp_init(k);
      in_step[k] = true;
      break;
    case storage: {
      const unsigned what = input.u8();
      if (what < 96) device.fail_storage(what % 4, what / 4);
      if (what >= 96 && what < 192) device.busy_storage(what % 8);
      if (what >= 192) device.cut_power_after(static_cast<std::uint32_t>(input.u16()) % 30000U);
      break;
    }
    default:
      device.power_on();
      in_step.fill(true);
  }
  device.end_of_operation();
}

void run(Input input) {
  Device device(input.u8());
  std::array<bool, Device::connections> in_step;
  in_step.fill(true);
  for (unsigned k = 0; k < 64 && !input.is_empty(); ++k) operate(device, input, in_step);
  device.check_active();
}

std::vector<Bytes> seeds() {
  const Bytes before = Output().u8(request).out;
  const Bytes other = Output().u8(0x80U | request).out;
  std::vector<Bytes> all;
  Output many;
  unsigned count = 0;
  for (const Bytes& sample : modbus_samples()) {
    if (count % 8 == 0) many = Output().u8(count % 16 == 0 ? 2 : 0).u8(steps).u8(2);
    many.add(count % 3 == 0 ? other : before).add(sample);
    if (++count % 8 == 0) all.push_back(many.out);
    if (count % 5 == 0)
      all.push_back(Output().u8(0).u8(portions).u8(count).u8(count % 9).u8(count).add(sample).u8(close).out);
  }
  all.push_back(many.out);
  add_command_seeds(before, other, all);
  add_signed_seeds(before, all);
  all.push_back(Output()
                    .u8(0)
                    .add(modbus_push(before, 5, 3, 2))
                    .add(modbus_push(other, 1, 4, 3))
                    .u8(close)
                    .u8(0x80U | open)
                    .u8(settle)
                    .out);
  all.push_back(
      Output().u8(0).add(modbus_push(before, 5, 3, 3)).u8(storage).u8(200).u16(13000).u8(settle).out);
  all.push_back(Output().u8(0).u8(raw).u8(12).u32(0x00000100).u32(0x03110600).u32(0x01000000).out);
  return all;
}

const Register registered({"modbus_tcp", run, seeds, nullptr});

}  // namespace
}  // namespace fuzz::modbus_tcp_target
