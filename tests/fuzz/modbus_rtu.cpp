// SPDX-License-Identifier: Apache-2.0
// Bytes of a serial line for a whole device, as they come or as frames with their CRC, with silences, polls, cycles and power
// failures between them. Input: the controller's start, then operations.
#include "modbus_requests.hpp"

namespace fuzz::modbus_rtu_target {
namespace {

constexpr unsigned frame = 0, raw = 2, line_poll = 3, store_poll = 4, line_error = 7, pieces = 8, storage = 9,
                   operations = 11;

unsigned unit(unsigned choice) { return choice < 160 ? unit_id : choice < 200 ? 0 : choice; }

void operate(Device& device, Input& input) {
  switch (input.u8() % operations) {
    case frame:
    case frame + 1: {
      const unsigned to = unit(input.u8());
      const std::uint32_t us = input.u16();
      device.rtu_frame(to, modbus_request(device, input), us);
      break;
    }
    case raw: {
      const std::uint32_t us = input.u16();
      device.rtu(input.bytes(input.u8()), us);
      break;
    }
    case line_poll:
      device.rtu_poll(input.u16());
      break;
    case store_poll:
      device.poll(input.u16());
      break;
    case settle:
      device.settle();
      break;
    case steps:
      device.ordinary_steps(1 + input.u8() % 24);
      break;
    case line_error:
      device.rtu_line_error((input.u8() & 1U) != 0);
      break;
    case pieces: {  // a frame in two pieces, or with a byte that is not its own
      Bytes all(1, static_cast<std::uint8_t>(unit(input.u8())));
      const unsigned at = input.u8();
      const std::uint32_t us = input.u16();
      const unsigned noise = input.u8();
      const Bytes pdu = modbus_request(device, input);
      all.insert(all.end(), pdu.begin(), pdu.end());
      all = Output().add(all).u16(modbus_crc_of(all)).out;
      const auto cut = all.begin() + static_cast<std::ptrdiff_t>(at % all.size());
      device.rtu(Bytes(all.begin(), cut), 2000);
      if (noise < 128) device.rtu({static_cast<std::uint8_t>(noise)}, us / 2);
      device.rtu(Bytes(cut, all.end()), us);
      break;
    }
    case storage: {
      const unsigned what = input.u8();
      if (what < 96) device.fail_storage(what % 4, what / 4);
      if (what >= 96 && what < 192) device.busy_storage(what % 8);
      if (what >= 192) device.cut_power_after(static_cast<std::uint32_t>(input.u16()) % 30000U);
      break;
    }
    default:
      device.power_on();
  }
  device.end_of_operation();
}

void run(Input input) {
  Device device(input.u8());
  for (unsigned k = 0; k < 64 && !input.is_empty(); ++k) operate(device, input);
  device.rtu_poll(10000);
  device.check_active();
}

std::vector<Bytes> seeds() {
  const Bytes before = Output().u8(frame).u8(0).u16(2000).out;
  std::vector<Bytes> all;
  Output many;
  unsigned count = 0;
  for (const Bytes& sample : modbus_samples()) {
    if (count % 8 == 0) many = Output().u8(count % 16 == 0 ? 2 : 0).u8(steps).u8(2);
    many.add(before).add(sample);
    if (++count % 8 == 0) all.push_back(many.out);
    // In pieces, to all, and to another unit.
    if (count % 5 == 0)
      all.push_back(Output()
                        .u8(0)
                        .u8(pieces)
                        .u8(0)
                        .u8(count)
                        .u16(count * 40)
                        .u8(count * 5)
                        .add(sample)
                        .u8(line_poll)
                        .u16(2000)
                        .out);
    if (count % 7 == 0)
      all.push_back(Output()
                        .u8(1)
                        .u8(frame)
                        .u8(170)
                        .u16(2000)
                        .add(sample)
                        .u8(frame)
                        .u8(255)
                        .u16(2000)
                        .add(sample)
                        .u8(line_error)
                        .u8(count)
                        .out);
  }
  all.push_back(many.out);
  add_command_seeds(before, before, all);
  add_signed_seeds(before, all);
  // Bytes in bursts: what begins after a silence may be a frame, also where the memory is full.
  const Bytes noise = Bytes(250, 17);
  for (const unsigned us : {1800U, 100U}) {
    Output out;
    out.u8(130).u8(raw).u16(us).u8(3).add(octets(17, 3, 0));
    out.u8(frame).u8(0).u16(us).add(octets(1, 0, 0, 2));
    for (int k = 0; k < 2; ++k) out.u8(raw).u16(us).u8(250).add(noise);
    out.u8(raw).u16(us).u8(9).add(octets(17, 16, 0, 0, 0, 100, 200, 1, 2)).u8(raw).u16(us).u8(250).add(noise);
    out.u8(frame).u8(0).u16(us).add(octets(1, 0, 0, 2)).u8(line_poll).u16(30000);
    all.push_back(out.out);
  }
  // Functions that no server of this map has, with their lengths.
  for (const unsigned function : {0x0FU, 0x16U, 0x05U, 0x07U})
    all.push_back(Output()
                      .u8(0)
                      .add(before)
                      .add(octets(0, 9, function, 0, 1, 0, 1, 2, 0, 0, 0))
                      .u8(line_poll)
                      .u16(2000)
                      .out);
  all.push_back(Output()
                    .u8(0)
                    .u8(raw)
                    .u16(10)
                    .u8(9)
                    .u32(0x12345678)
                    .u32(0x03111111)
                    .u8(0)
                    .u8(line_poll)
                    .u16(1800)
                    .add(before)
                    .u8(9)
                    .u8(17)
                    .out);
  all.push_back(
      Output().u8(0).add(modbus_push(before, 5, 3, 3)).u8(storage).u8(200).u16(13000).u8(settle).out);
  return all;
}

const Register registered({"modbus_rtu", run, seeds, nullptr});

}  // namespace
}  // namespace fuzz::modbus_rtu_target
