// SPDX-License-Identifier: Apache-2.0
// Frames of CAN for a whole device, with polls, time, cycles and power failures between them. Input: the controller's start,
// then operations: a byte each with its operands.
#include "whole_device.hpp"

namespace fuzz::canopen_target {
namespace {

// What an SDO client may ask for; a byte of the input chooses one, or 255: index and sub-index as they come.
constexpr std::uint16_t objects[][2] = {
    {0x1000, 0}, {0x1001, 0}, {0x1008, 0}, {0x100A, 0}, {0x1010, 1}, {0x1011, 1}, {0x1017, 0}, {0x1018, 0},
    {0x1018, 2}, {0x1018, 4}, {0x1200, 0}, {0x1200, 1}, {0x1200, 2}, {0x2000, 0}, {0x2001, 0}, {0x2002, 0},
    {0x2002, 1}, {0x2002, 7}, {0x2003, 0}, {0x2004, 0}, {0x2005, 0}, {0x2005, 1}, {0x2005, 9}, {0x2010, 0},
    {0x2010, 1}, {0x2010, 2}, {0x2011, 0}, {0x2011, 1}, {0x2011, 2}, {0x2020, 0}, {0x2020, 1}, {0x2020, 2},
    {0x2021, 0}, {0x2021, 1}, {0x2021, 7}, {0x1003, 0}, {0x1014, 0}, {0x1201, 0}, {0x1A00, 0}, {0x1800, 1}};
constexpr unsigned object_count = sizeof objects / sizeof objects[0];

struct Object {
  unsigned index;
  unsigned sub;
};
Object object(Input& input) {
  const unsigned k = input.u8();
  if (k == 255) {
    const unsigned index = input.u16();
    return {index, input.u8()};
  }
  return {objects[k % object_count][0], objects[k % object_count][1]};
}

constexpr unsigned operations = 20;

void operate(Device& device, Input& input) {
  switch (input.u8() % operations) {
    case 0:
    case 1:
      device.sdo(input.bytes(8));
      break;
    case 2: {  // any frame, also shorter and longer than one can be
      const unsigned id = input.u16();
      device.frame(id, input.bytes(input.u8() % 13));
      break;
    }
    case 3:  // NMT
      device.frame(0, input.bytes(2));
      break;
    case 4: {
      const Object o = object(input);
      device.upload(o.index, o.sub, input.u8());
      break;
    }
    case 5: {
      const Object o = object(input);
      const unsigned how = input.u8();
      device.download(o.index, o.sub, input.bytes(how & 0x7FU), (how & 0x80U) != 0);
      break;
    }
    case 6: {  // begins an upload or a download and leaves it there
      const Object o = object(input);
      device.sdo(Output().u8(input.u8()).u16(o.index).u8(o.sub).u32(input.u32()).out);
      break;
    }
    case 7:  // a segment that may or may not be expected
      device.sdo(Output().u8(input.u8() & 0x7FU).add(input.bytes(7)).out);
      break;
    case 8: {  // an image that is good, or would be but for a byte
      const unsigned which = input.u8();
      Bytes image = good_image(which % image_count, input.u8());
      if ((which & 0x80U) != 0) image[input.u16() % image.size()] ^= input.u8();
      if ((which & 0x40U) != 0) mend_crc(image);
      device.download(0x2010, 1, image, (which & 0x20U) == 0);
      break;
    }
    case 9: {  // argument and command
      const unsigned command = input.u8();
      if ((command & 0x80U) != 0) device.download(0x2011, 1, Output().u32(input.u32()).out, true);
      device.download(0x2011, 2, Output().u16(command & 0x0FU).out, true);
      break;
    }
    case 10:  // "save", "load"
      device.download((input.u8() & 1U) == 0 ? 0x1010 : 0x1011, 1,
                      bytes_of((input.u8() & 1U) == 0 ? "save" : "load"), true);
      break;
    case 11:
      device.settle();
      break;
    case 12:
      device.can_poll(input.u16());
      break;
    case 13:
      device.poll(input.u16());
      break;
    case 14:
      device.ordinary_steps(1 + input.u8() % 24);
      break;
    case 15: {
      Bytes request(216);
      const Bytes given = input.bytes(input.u8() % 217U);
      std::copy(given.begin(), given.end(), request.begin());
      device.download(0x2020, 1, request, true);
      device.upload(0x2020, 2, 20);
      break;
    }
    case 16: {
      const unsigned what = input.u8();
      if (what < 64) device.refuse_frames(what % 4);
      if (what >= 64 && what < 128) device.fail_storage(what % 4);
      if (what >= 128 && what < 192) device.busy_storage(what % 8);
      if (what >= 192 && what < 224) device.cut_power_after(static_cast<std::uint32_t>(input.u16()) % 30000U);
      if (what >= 224) {
        const std::uint32_t offset = input.u16();
        device.spoil(what, offset, input.u8());
      }
      break;
    }
    case 17: {  // a good image in blocks, or other bytes
      const unsigned which = input.u8();
      const Bytes image = which < 128 ? good_image(which, input.u8()) : input.bytes(which);
      device.block_download(0x2010, 1, image, input.u8());
      break;
    }
    case 18: {
      const Object o = object(input);
      const unsigned most = input.u8();
      device.block_upload(o.index, o.sub, most, input.u8());
      break;
    }
    default: {
      const unsigned what = input.u8();
      if ((what & 1U) == 0) {
        device.power_on(what / 2 % 16);
      } else {
        device.again_can();
      }
    }
  }
  device.end_of_operation();
}

void run(Input input) {
  Device device(input.u8());
  device.can_poll(
      1);  // boot-up: before it there is no SDO; operation 19 makes a node that has not spoken yet
  for (unsigned k = 0; k < 64 && !input.is_empty(); ++k) operate(device, input);
  device.check_active();
}

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  // Every object read, and written by four bytes and by twelve; with two sets and with none.
  for (unsigned first = 0; first < object_count; first += 8) {
    Output out;
    out.u8(first % 16 == 0 ? 2 : 0).u8(12).u16(1);
    for (unsigned k = first; k < first + 8 && k < object_count; ++k) {
      out.u8(4).u8(k).u8(90);
      if (k % 2 == 0) out.u8(5).u8(k).u8(0x84).u32(1);
      if (k % 3 == 0) out.u8(5).u8(k).u8(0x0C).u32(1).u32(2).u32(3);
    }
    all.push_back(out.out);
  }
  // A push: download, verify, commit, cycles, reading back, on trial, confirmed, rolled back, restored.
  all.push_back(Output()
                    .u8(0)
                    .u8(12)
                    .u16(1)
                    .u8(8)
                    .u8(2)
                    .u8(5)
                    .u8(9)
                    .u8(2)
                    .u8(11)
                    .u8(9)
                    .u8(3)
                    .u8(11)
                    .u8(14)
                    .u8(20)
                    .u8(4)
                    .u8(25)
                    .u8(250)
                    .out);
  all.push_back(Output()
                    .u8(1)
                    .u8(14)
                    .u8(3)
                    .u8(8)
                    .u8(3)
                    .u8(9)
                    .u8(9)
                    .u8(0x84)
                    .u32(10)
                    .u8(11)
                    .u8(14)
                    .u8(5)
                    .u8(9)
                    .u8(5)
                    .u8(11)
                    .u8(14)
                    .u8(9)
                    .u8(9)
                    .u8(6)
                    .u8(11)
                    .out);
  all.push_back(Output()
                    .u8(1)
                    .u8(14)
                    .u8(3)
                    .u8(8)
                    .u8(3)
                    .u8(9)
                    .u8(9)
                    .u8(0x84)
                    .u32(10)
                    .u8(11)
                    .u8(14)
                    .u8(23)
                    .u8(14)
                    .u8(23)
                    .u8(13)
                    .u16(1)
                    .u8(19)
                    .u8(0)
                    .out);
  all.push_back(
      Output().u8(2).u8(14).u8(3).u8(9).u8(6).u8(11).u8(14).u8(9).u8(10).u8(1).u8(1).u8(11).u8(19).u8(0).out);
  all.push_back(Output()
                    .u8(0)
                    .u8(8)
                    .u8(0x20)
                    .u8(9)
                    .u8(10)
                    .u8(0)
                    .u8(0)
                    .u8(16)
                    .u8(200)
                    .u16(13000)
                    .u8(11)
                    .u8(11)
                    .u8(19)
                    .u8(0)
                    .out);
  all.push_back(Output().u8(0).u8(8).u8(1).u8(9).u8(9).u8(3).u8(16).u8(66).u8(11).u8(9).u8(7).out);
  // A start whose readings fail, one more each time; a slot whose image, seals or marks have changed.
  for (unsigned failing = 1; failing < 16; ++failing)
    all.push_back(
        Output().u8(2).u8(19).u8(2 * failing).u8(14).u8(3).u8(9).u8(6).u8(11).u8(19).u8(2 * failing).out);
  for (unsigned slot = 0; slot < 2; ++slot) {
    for (const unsigned offset : {0U, 100U, FLEXCOMP_SLOT_BYTES - 1U, FLEXCOMP_SLOT_BYTES - 33U,
                                  FLEXCOMP_SLOT_BYTES - 70U, FLEXCOMP_SLOT_BYTES - 180U})
      all.push_back(
          Output().u8(2).u8(16).u8(224 + slot).u16(offset).u8(1).u8(14).u8(3).u8(9).u8(6).u8(11).out);
  }
  // Readings that fail in a rollback, after it was accepted; a set that costs too much.
  for (unsigned failing = 1; failing < 4; ++failing)
    all.push_back(Output().u8(2).u8(14).u8(3).u8(9).u8(6).u8(16).u8(64 + failing).u8(11).u8(14).u8(9).out);
  all.push_back(Output().u8(0).u8(8).u8(6).u8(9).u8(2).u8(11).u8(9).u8(3).u8(11).out);
  // In blocks, whole, with a wrong CRC, with segments that got lost; after a pause.
  for (unsigned image = 0; image < 6; ++image)
    all.push_back(Output()
                      .u8(0)
                      .u8(17)
                      .u8(image)
                      .u8(9)
                      .u8(image == 4 ? 1 : 0)
                      .u8(9)
                      .u8(2)
                      .u8(11)
                      .u8(9)
                      .u8(3)
                      .u8(11)
                      .u8(14)
                      .u8(3)
                      .u8(18)
                      .u8(25)
                      .u8(127)
                      .u8(0)
                      .out);
  for (unsigned k = 0; k < object_count; ++k)
    all.push_back(
        Output().u8(2).u8(14).u8(3).u8(18).u8(k).u8(k % 3 == 0 ? 5 : 127).u8(k % 4).u8(12).u16(3000).out);
  all.push_back(Output().u8(0).u8(17).u8(140).add(Bytes(140, 5)).u8(0).out);
  // Probe, heartbeat, NMT, a transfer that is left, answers that are not taken.
  all.push_back(Output()
                    .u8(2)
                    .u8(14)
                    .u8(3)
                    .u8(15)
                    .u8(8)
                    .u32(0)
                    .u32(0x3FD00000)
                    .u8(5)
                    .u8(6)
                    .u8(0x82)
                    .u16(50)
                    .u8(12)
                    .u16(60)
                    .u8(3)
                    .u8(2)
                    .u8(5)
                    .u8(3)
                    .u8(1)
                    .u8(0)
                    .u8(3)
                    .u8(129)
                    .u8(5)
                    .u8(12)
                    .u16(10)
                    .out);
  all.push_back(Output()
                    .u8(0)
                    .u8(6)
                    .u8(24)
                    .u8(0x21)
                    .u32(400)
                    .u8(7)
                    .u8(0)
                    .u32(1)
                    .u16(2)
                    .u8(3)
                    .u8(12)
                    .u16(3000)
                    .u8(7)
                    .u8(0x10)
                    .u32(1)
                    .u16(2)
                    .u8(3)
                    .u8(16)
                    .u8(2)
                    .u8(4)
                    .u8(1)
                    .u8(9)
                    .u8(12)
                    .u16(1)
                    .out);
  all.push_back(Output()
                    .u8(0)
                    .u8(2)
                    .u16(0x605)
                    .u8(3)
                    .u8(0x40)
                    .u16(0x1000)
                    .u8(2)
                    .u16(0x600)
                    .u8(8)
                    .u32(0)
                    .u32(0)
                    .u8(0)
                    .u8(0xA4)
                    .u16(0x2000)
                    .u8(0)
                    .u8(10)
                    .u16(0)
                    .u8(0)
                    .out);
  return all;
}

const Register registered({"canopen", run, seeds, nullptr});

}  // namespace
}  // namespace fuzz::canopen_target
