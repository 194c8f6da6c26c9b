// SPDX-License-Identifier: Apache-2.0
// Frames of CAN for a whole device, with polls, time, cycles and power failures between them. Input: the controller's start,
// then operations: a byte each with its operands.
#include "whole_device.hpp"

namespace fuzz::canopen_target {
namespace {

// What an SDO client may ask for; a byte of the input chooses one, or 255: index and sub-index as they come.
constexpr std::uint16_t objects[][2] = {
    {0x1000, 0}, {0x1001, 0}, {0x1003, 0}, {0x1003, 1}, {0x1008, 0}, {0x100A, 0}, {0x1010, 0}, {0x1010, 1},
    {0x1010, 2}, {0x1011, 0}, {0x1011, 1}, {0x1011, 2}, {0x1014, 0}, {0x1015, 0}, {0x1017, 0}, {0x1018, 0},
    {0x1018, 2}, {0x1018, 4}, {0x1200, 0}, {0x1200, 1}, {0x1200, 2}, {0x1201, 0}, {0x1201, 1}, {0x1201, 2},
    {0x1800, 0}, {0x1800, 1}, {0x1800, 2}, {0x1800, 3}, {0x1800, 5}, {0x1A00, 0}, {0x1A00, 3}, {0x2000, 0},
    {0x2001, 0}, {0x2002, 0}, {0x2002, 1}, {0x2002, 7}, {0x2003, 0}, {0x2004, 0}, {0x2005, 0}, {0x2005, 1},
    {0x2005, 2}, {0x2005, 3}, {0x2005, 9}, {0x2006, 0}, {0x2010, 0}, {0x2010, 1}, {0x2010, 2}, {0x2011, 0},
    {0x2011, 1}, {0x2011, 2}, {0x2020, 0}, {0x2020, 1}, {0x2020, 2}, {0x2021, 0}, {0x2021, 1}, {0x2021, 7}};
constexpr unsigned object_count = sizeof objects / sizeof objects[0];

constexpr unsigned number_of(unsigned index, unsigned sub) {
  unsigned k = 0;
  while (objects[k][0] != index || objects[k][1] != sub) ++k;
  return k;
}

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

enum : unsigned {
  request,
  request_too,
  any_frame,
  nmt,
  upload,
  download,
  begin_transfer,  // an upload or a download, which is left there
  segment,         // that may or may not be expected
  image_download,
  command,
  save_load,
  settle,
  bus_poll,
  store_poll,
  cycles,
  probe,
  trouble,
  image_in_blocks,
  object_in_blocks,
  power,
  signed_command,
  unlock,
  channel,
  node_again,
  push_beside,
  operations
};

constexpr unsigned leaves = 8;  ///< of Disturbance::from(): without a frame

void run_command(Device& device, unsigned number) {
  device.download(0x2011, 2, Output().u16(number).out, true);
}

void operate(Device& device, Input& input) {
  switch (input.u8() % operations) {
    case request:
    case request_too:
      device.sdo(input.bytes(8));
      break;
    case any_frame: {  // also shorter and longer than one can be
      const unsigned id = input.u16();
      device.frame(id, input.bytes(input.u8() % 13));
      break;
    }
    case nmt:
      device.frame(0, input.bytes(2));
      break;
    case upload: {
      const Object o = object(input);
      device.upload(o.index, o.sub, input.u8());
      break;
    }
    case download: {
      const Object o = object(input);
      const unsigned how = input.u8();
      device.download(o.index, o.sub, input.bytes(how & 0x7FU), (how & 0x80U) != 0);
      break;
    }
    case begin_transfer: {
      const Object o = object(input);
      device.sdo(Output().u8(input.u8()).u16(o.index).u8(o.sub).u32(input.u32()).out);
      break;
    }
    case segment:
      device.sdo(Output().u8(input.u8() & 0x7FU).add(input.bytes(7)).out);
      break;
    case image_download: {  // good, or would be but for a byte
      const unsigned which = input.u8();
      Bytes image = device.image(which % 16, input.u8(), which % 16 == 15 ? 2 : 0);
      if ((which & 0x80U) != 0) image[input.u16() % image.size()] ^= input.u8();
      if ((which & 0x40U) != 0) mend_crc(image);
      if ((which & 0x10U) != 0 && device.trusted() != 0) mend_signature(image, 0);
      device.download(0x2010, 1, image, (which & 0x20U) == 0);
      break;
    }
    case command: {  // with its argument
      const unsigned number = input.u8();
      if ((number & 0x80U) != 0) device.download(0x2011, 1, Output().u32(input.u32()).out, true);
      run_command(device, number & 0x0FU);
      break;
    }
    case save_load: {
      const unsigned which = input.u8();
      device.download((which & 1U) == 0 ? 0x1010 : 0x1011, (which & 2U) == 0 ? 1 : 2,
                      bytes_of((input.u8() & 1U) == 0 ? "save" : "load"), true);
      break;
    }
    case settle:
      device.settle();
      break;
    case bus_poll:
      device.can_poll(input.u16());
      break;
    case store_poll:
      device.poll(input.u16());
      break;
    case cycles:
      device.ordinary_steps(1 + input.u8() % 24);
      break;
    case probe: {
      Bytes record(216);
      const Bytes given = input.bytes(input.u8() % 217U);
      std::copy(given.begin(), given.end(), record.begin());
      device.download(0x2020, 1, record, true);
      device.upload(0x2020, 2, 20);
      break;
    }
    case trouble: {
      const unsigned what = input.u8();
      if (what < 64) device.refuse_frames(what % 4);
      if (what >= 64 && what < 128) device.fail_storage(what % 4 == 3 ? 60 : what % 4, input.u8());
      if (what >= 128 && what < 184) device.busy_storage(what % 8);
      if (what >= 184 && what < 192) device.slow_checks(input.u8());
      if (what >= 192 && what < 224) device.cut_power_after(static_cast<std::uint32_t>(input.u16()) % 30000U);
      if (what >= 224 && what < 252) {
        const std::uint32_t offset = input.u16();
        device.spoil(what, offset, input.u8());
      }
      if (what >= 252) device.spoil_can(what, input.u8());
      break;
    }
    case image_in_blocks: {  // good, or other bytes
      const unsigned which = input.u8();
      const Bytes image = which < 128 ? device.image(which, input.u8()) : input.bytes(which);
      const unsigned wrong = input.u8();
      device.block_download(0x2010, 1, image, wrong, Disturbance::from(input));
      break;
    }
    case object_in_blocks: {
      const Object o = object(input);
      const unsigned most = input.u8();
      const unsigned lost = input.u8();
      const unsigned switch_to = input.u8();
      device.block_upload(o.index, o.sub, most, lost, switch_to, Disturbance::from(input));
      break;
    }
    case signed_command: {
      const unsigned which = input.u8();
      const unsigned key = which >> 4U & 3U;
      Bytes bytes = device.signed_command(which & 0x0FU, input.u8(), key % key_count);
      const unsigned wrong = input.u8();
      if ((wrong & 1U) != 0) bytes[input.u8() % bytes.size()] ^= input.u8();
      if ((wrong & 2U) != 0) Device::mend_command(bytes, key % key_count);
      if ((wrong & 4U) != 0) mend_crc(bytes);
      if ((wrong & 8U) != 0) bytes.pop_back();
      device.download(0x2010, 1, bytes, true);
      run_command(device, 2);
      device.settle();
      run_command(device, which & 0x0FU);
      break;
    }
    case unlock:
      device.poll(1);  // without one there is no challenge
      device.download(0x2011, 1, Output().u32(0).out, true);
      run_command(device, 9);
      device.download(0x2011, 1, Output().u32(device.state().detail ^ input.u8()).out, true);
      run_command(device, 9);
      device.download(0x2011, 1, Output().u32(0).out, true);
      break;
    case channel:
      device.use_channel((input.u8() & 1U) != 0);
      break;
    case node_again: {
      const unsigned frames = input.u8();
      const unsigned request_id = input.u16();
      device.again_can(frames, request_id, input.u16());
      break;
    }
    case push_beside: {
      const unsigned which = input.u8();
      device.push(device.image(which, input.u8()));
      break;
    }
    default:
      device.power_on(input.u8() % 16);
  }
  device.end_of_operation();
}

void run(Input input) {
  Device device(input.u8());
  device.can_poll(
      1);  // boot-up: before it there is no SDO; `node_again` makes a node that has not spoken yet
  for (unsigned k = 0; k < 64 && !input.is_empty(); ++k) operate(device, input);
  device.check_active();
}

/// What some seeds of one kind share.
class Seeds {
 public:
  std::vector<Bytes> all;

  void add(const Bytes& bytes) { all.push_back(bytes); }
  void add(const Bytes& first, const Bytes& then) { all.push_back(Output().add(first).add(then).out); }
};

/// A set into staging, committed or on trial, and taken up.
Bytes push(unsigned image, unsigned sequence, unsigned cycles_on_trial = 0) {
  Output out;
  out.add(octets(image_download, image, sequence, command));
  if (cycles_on_trial == 0) out.u8(3);
  if (cycles_on_trial != 0) out.u8(0x84).u32(cycles_on_trial);
  return out.add(octets(settle, cycles, 4)).out;
}

void add_objects(Seeds& seeds) {
  // Every object read, and written by one, two, four and twelve bytes; with two sets and with none.
  for (unsigned first = 0; first < object_count; first += 8) {
    Output out;
    out.u8(first % 16 == 0 ? 2 : 0).add(octets(bus_poll, 1, 0, cycles, 3));
    for (unsigned k = first; k < first + 8 && k < object_count; ++k) {
      out.add(octets(upload, k, 90, download, k, 0x81, 0, download, k, 0x82, 7, 0));
      if (k % 2 == 0) out.add(octets(download, k, 0x84, 1, 0, 0, 0));
      if (k % 3 == 0) out.add(octets(download, k, 12)).u32(1).u32(2).u32(3);
    }
    seeds.add(out.out);
  }
  // In blocks; with another size of sub-blocks, lost segments, a switch to segments.
  for (unsigned k = 0; k < object_count; ++k)
    seeds.add(octets(2, cycles, 3, object_in_blocks, k, k % 3 == 0 ? 5U : 127U, k % 4, k % 5 == 0 ? 200U : 0U,
                     255, leaves, bus_poll, 0xB8, 0x0B));
}

void add_sets(Seeds& seeds) {
  // Verified and committed, read back; on trial: confirmed, rolled back, run out; a set that costs too much.
  seeds.add(octets(0, image_download, 2, 5, command, 2, settle, command, 3, settle, cycles, 20, upload,
                   number_of(0x2010, 2), 250));
  for (const unsigned start : {1U, 33U, 65U, 97U}) {
    seeds.add(Output().u8(start).u8(cycles).u8(3).add(push(3, 9, 10)).out,
              octets(command, 5, settle, cycles, 9, command, 6, settle));
    seeds.add(Output().u8(start).u8(cycles).u8(3).add(push(3, 9, 10)).out,
              octets(cycles, 23, cycles, 23, store_poll, 1, 0, command, 5, power, 0));
    seeds.add(Output().u8(start).u8(cycles).u8(3).add(push(4, 9, 10)).out,
              octets(command, 6, settle, power, 0));
    seeds.add(octets(start, cycles, 3, unlock, 0, command, 6, settle, cycles, 9, unlock, 0, save_load, 1, 1,
                     settle, power, 0));
    seeds.add(octets(start, cycles, 3, unlock, 1, command, 6, unlock, 0, unlock, 0, command, 8, settle));
  }
  seeds.add(octets(0, image_download, 6, 9, command, 2, settle, command, 3, settle));
  seeds.add(octets(0, image_download, 0x20, 9, save_load, 0, 0, trouble, 200, 0xC8, 0x32, settle, settle,
                   power, 0));
  // A storage that fails, once or more often, after so many calls; at a start; in a rollback.
  for (unsigned failing = 1; failing < 4; ++failing) {
    for (unsigned after = 0; after < 24; ++after)
      seeds.add(octets(1, cycles, 3, image_download, 0, 9, trouble, 64 + failing, after, command, 3, settle,
                       cycles, 4, command, 6, settle, power, 0));
    for (unsigned after = 0; after < 8; ++after)
      seeds.add(octets(2, cycles, 3, unlock, 0, trouble, 64 + failing, after, command, 6, settle, cycles, 9));
  }
  for (unsigned after = 8; after < 40; ++after)
    seeds.add(Output().u8(1).u8(cycles).u8(3).add(push(0, 9, 100)).out,
              octets(trouble, 67, after - 8, command, 5, settle, power, 0));
  for (unsigned failing = 1; failing < 16; ++failing)
    seeds.add(octets(2, power, failing, cycles, 3, unlock, 0, command, 6, settle, power, failing));
  // A slot whose image, seals or marks have changed.
  for (unsigned slot = 0; slot < 2; ++slot) {
    for (const unsigned from_end :
         {FLEXCOMP_SLOT_BYTES - 0U, FLEXCOMP_SLOT_BYTES - 100U, 1U, 33U, 70U, 180U}) {
      const unsigned offset = FLEXCOMP_SLOT_BYTES - from_end;
      seeds.add(octets(2, trouble, 224 + slot, offset & 0xFFU, offset >> 8U, 1, cycles, 3, unlock, 0, command,
                       6, settle));
    }
  }
  for (unsigned cut = 0; cut < 24; ++cut)
    seeds.add(octets(1 + 32 * (cut % 2), cycles, 3, image_download, 0, 9, trouble, 200, cut * 80 & 0xFFU,
                     cut * 80 >> 8U, command, 3, settle, settle, power, 0, cycles, 3, push_beside, 1, 20));
}

void add_authority(Seeds& seeds) {
  // Signed by a key that is trusted, and by one that is not; with a counter that was used; altered; altered and signed.
  for (const unsigned start : {32U, 33U, 34U, 66U}) {
    seeds.add(octets(start, cycles, 3, image_download, 2, 9, command, 2, settle, command, 3, settle, cycles,
                     9, image_download, 2, 9, command, 3, settle, power, 0, upload, number_of(0x2006, 0),
                     30));
    seeds.add(octets(start, cycles, 3, image_download, 15, 20, command, 2, settle, image_download, 0x92, 30,
                     100, 0, 1, command, 2, settle, image_download, 0xC2, 31, 120, 0, 1, command, 2, settle));
    for (unsigned number = 4; number < 10; ++number)
      seeds.add(octets(start, cycles, 3, signed_command, number, 40, 0, settle, cycles, 4, signed_command,
                       number, 40, 0, power, 0, cycles, 3, signed_command, number, 41, 0, settle, power, 0));
    for (const unsigned at : {0U, 4U, 8U, 12U, 24U, 56U, 64U, 127U, 128U}) {
      seeds.add(octets(start, cycles, 3, signed_command, 6, 40, 1, at, 1, signed_command, 6, 41, 5, at, 1,
                       signed_command, 6, 42, 3, at, 1, settle));
    }
    seeds.add(octets(start, cycles, 3, signed_command, 0x28, 40, 0, signed_command, 0x16, 50, 8, settle));
    // A check that takes its time, that is given up, that nobody ends.
    seeds.add(octets(start, cycles, 3, trouble, 184, 20, image_download, 2, 9, command, 2, settle, trouble,
                     184, 255, command, 3, store_poll, 1, 0, command, 7, settle));
    seeds.add(octets(start, cycles, 3, trouble, 184, 255, image_download, 2, 9, command, 3, store_poll, 1, 0,
                     settle, store_poll, 0, 200, store_poll, 0, 200, settle));
    for (unsigned after = 0; after < 6; ++after)
      seeds.add(octets(start, cycles, 3, trouble, 65, after, signed_command, 6, 60, 0, settle, cycles, 3,
                       signed_command, 8, 61, 0, settle, power, 0));
  }
}

void add_blocks(Seeds& seeds) {
  // Whole, with a wrong CRC, with the end twice.
  for (unsigned image = 0; image < 6; ++image)
    seeds.add(octets(0, image_in_blocks, image, 9,
                     image == 4   ? 2U
                     : image == 3 ? 1U
                                  : 0U,
                     255, leaves * (image / 5), 0xC1, 0, 0, 0, 0, 0, 0, 0, command, 2, settle, command, 3,
                     settle, cycles, 3, object_in_blocks, number_of(0x2010, 2), 127, 0, 0, 255, 0, 0xA2, 0,
                     127, 0, 0, 0, 0, 0));
  seeds.add(octets(0, image_in_blocks, 140), Output().add(Bytes(140, 5)).add(octets(0, 255, leaves)).out);
  // What comes into the middle of a transfer, in either direction.
  static const Bytes frames[] = {
      {0x80, 0x10, 0x20, 1, 0, 0, 0, 0},    // abort
      {0x40, 0x01, 0x10, 0, 0, 0, 0, 0},    // upload of a small object, served beside
      {0x40, 0x03, 0x10, 8, 0, 0, 0, 0},    // of one that has nothing
      {0x40, 0x00, 0x20, 0, 0, 0, 0, 0},    // of a record
      {0x21, 0x10, 0x20, 1, 100, 0, 0, 0},  // another download
      {0x60, 0, 0, 0, 0, 0, 0, 0},          // segments of an upload and of a download
      {0x00, 1, 2, 3, 4, 5, 6, 7},          //
      {0xC1, 0, 0, 0, 0, 0, 0, 0},          // the end of a download
      {0xC6, 0x10, 0x20, 1, 100, 0, 0, 0},  // another download in blocks
      {0xA4, 0x01, 0x20, 0, 127, 0, 0, 0},  // another upload in blocks
      {0xA1, 0, 0, 0, 0, 0, 0, 0},          // the end of an upload
      {0xA2, 0x7F, 127, 0, 0, 0, 0, 0},     // acknowledges more than was sent
      {0xA2, 0, 0, 0, 0, 0, 0, 0},          // sub-blocks without a segment
      {0xA2, 1, 64, 0, 0, 0, 0, 0},         //
      {0xA3, 0, 0, 0, 0, 0, 0, 0},          // start
      {0x3F, 1, 2, 3, 4, 5, 6, 7},          // a segment that is not the next one
      {0x7E, 1, 2, 3, 4, 5, 6, 7},          //
      {0xE0, 0, 0, 0, 0, 0, 0, 0}};         // a specifier that nobody has
  for (const Bytes& frame : frames) {
    for (const unsigned before : {0U, 3U, 63U, 64U, 255U})
      seeds.add(octets(0, image_in_blocks, before % 2, 9, 0, before, 0), frame);
    for (const unsigned before : {0U, 1U, 2U, 254U, 255U})
      seeds.add(octets(2, cycles, 3, object_in_blocks,
                       before == 2 ? number_of(0x2010, 2) : number_of(0x2003, 0), 20, 0, 0, before, 0),
                frame);
    seeds.add(octets(0, request), frame);
  }
  for (unsigned how = 1; how < 16; ++how) {
    for (const unsigned before : {1U, 5U, 63U, 255U})
      seeds.add(octets(2, cycles, 3, image_in_blocks, 1, 9, 0, before, how, 0x88, 0x13, 0, 0, 0, 0, 0, 0,
                       object_in_blocks, number_of(0x2010, 2), 30, 0, 0, before == 63 ? 254 : before % 5, how,
                       0x88, 0x13, 0, 0, 0, 0, 0, 0));
  }
  // More segments than were announced, and those that were under way then.
  seeds.add(octets(0, begin_transfer, number_of(0x2011, 1), 0xC6, 4, 0, 0, 0, request, 1, 0, 0, 0, 0, 0, 0, 0,
                   request, 2, 0, 0, 0, 0, 0, 0, 0, request, 3, 0, 0, 0, 0, 0, 0, 0, request, 5, 0, 0, 0, 0,
                   0, 0, 0));
}

void add_segments(Seeds& seeds) {
  // A transfer that is left; doubled segments; wrong toggle bits; a set that changes under an upload.
  const unsigned staging = number_of(0x2010, 1), active = number_of(0x2010, 2);
  seeds.add(octets(0, begin_transfer, staging, 0x21, 144, 1, 0, 0, segment, 0, 1, 0, 0, 0, 2, 0, 3, bus_poll,
                   0xB8, 0x0B, segment, 0x10, 1, 0, 0, 0, 2, 0, 3, trouble, 2, upload, 1, 9, bus_poll, 1, 0));
  for (const unsigned toggle : {0x00U, 0x10U}) {
    seeds.add(octets(0, begin_transfer, staging, 0x21, 144, 1, 0, 0, segment, toggle, 1, 2, 3, 4, 5, 6, 7,
                     segment, toggle, 1, 2, 3, 4, 5, 6, 7, segment, toggle ^ 0x10U, 1, 2, 3, 4, 5, 6, 7));
    seeds.add(octets(2, cycles, 3, begin_transfer, active, 0x40, 0, 0, 0, 0, segment, 0x60 + toggle, 0, 0, 0,
                     0, 0, 0, 0, segment, 0x60 + toggle, 0, 0, 0, 0, 0, 0, 0, push_beside, 1, 50, cycles, 3,
                     segment, 0x70 - toggle, 0, 0, 0, 0, 0, 0, 0));
  }
  seeds.add(octets(0, any_frame, 5, 6, 3, 0x40, 0, 0x10, any_frame, 0, 6, 8, 0, 0, 0, 0, 0, 0, 0, 0, request,
                   0xA4, 0, 0x20, 0, 10, 0, 0, 0));
}

void add_network(Seeds& seeds) {
  const unsigned emergency = number_of(0x1014, 0), pdo = number_of(0x1800, 1);
  // Probe, heartbeat, NMT.
  seeds.add(octets(2, cycles, 3, probe, 8, 0, 0, 0, 0, 0, 0, 0xD0, 0x3F, download, number_of(0x1017, 0), 0x82,
                   50, 0, bus_poll, 60, 0, nmt, 2, 5, nmt, 1, 0, nmt, 128, 5, nmt, 129, 5, bus_poll, 10, 0));
  // The TPDO: its identifier, times and type; in operational.
  seeds.add(octets(2, cycles, 3, download, pdo, 0x84, 0x85, 1, 0, 0x40, nmt, 1, 5, bus_poll, 1, 0, cycles, 3,
                   push_beside, 1, 20, bus_poll, 200, 0, download, pdo + 2, 0x82, 1, 0, download, pdo + 3,
                   0x82, 5, 0, bus_poll, 9, 0, bus_poll, 200, 0, trouble, 1, bus_poll, 200, 0));
  seeds.add(octets(2, download, pdo + 1, 0x81, 1, download, pdo + 1, 0x81, 255, download, pdo + 2, 0x82, 1, 0,
                   download, pdo + 3, 0x82, 5, 0, download, pdo, 0x84, 0x85, 1, 0, 0x40, nmt, 1, 5, bus_poll,
                   9, 0, bus_poll, 9, 0, download, pdo, 0x84, 0x85, 1, 0, 0));
  // Identifiers that are restricted, taken, changed while in use, or have bits that they must not.
  for (const unsigned which : {emergency, pdo, number_of(0x1201, 1), number_of(0x1201, 2)}) {
    for (const unsigned id : {0x85U, 0x185U, 0x585U, 0x601U, 0x684U, 0x6B4U, 0x7FFU, 0x6C0U})
      seeds.add(octets(0, download, which, 0x84, id & 0xFFU, id >> 8U, 0, 0x80, download, which, 0x84,
                       id & 0xFFU, id >> 8U, 0, 0, download, which, 0x84, id & 0xFFU, id >> 8U, 1, 0,
                       bus_poll, 1, 0));
  }
  // Faults: emergencies, their history, the time between them; the history emptied.
  seeds.add(octets(1, cycles, 3, image_download, 1, 9, trouble, 65, 3, command, 3, settle, bus_poll, 1, 0,
                   upload, number_of(0x1003, 0), 1, upload, number_of(0x1003, 1), 1, bus_poll, 200, 0,
                   download, number_of(0x1015, 0), 0x82, 10, 0, image_download, 1, 9, command, 3, settle,
                   bus_poll, 1, 0, download, number_of(0x1003, 0), 0x81, 1, download, number_of(0x1003, 0),
                   0x81, 0));
  // What the network sets up is kept, lost, damaged, and not kept at all.
  for (const unsigned start : {0U, 128U}) {
    seeds.add(octets(start, download, number_of(0x1017, 0), 0x82, 50, 0, save_load, 2, 0, nmt, 130, 5,
                     bus_poll, 1, 0, bus_poll, 60, 0, save_load, 3, 1, nmt, 130, 5, bus_poll, 1, 0, trouble,
                     65, 0, save_load, 2, 0));
    seeds.add(octets(start, save_load, 2, 0, trouble, 253, 9, nmt, 130, 0, bus_poll, 1, 0, upload, 8, 1));
  }
  // Two clients: one waits for the other.
  seeds.add(octets(0, image_download, 1, 9, channel, 1, image_download, 2, 10, command, 2, store_poll, 0x10,
                   0x27, channel, 0, image_download, 1, 9, channel, 1, image_download, 2, 10, command, 3,
                   settle, channel, 0, image_download, 1, 9, command, 7, command, 9));
  for (const unsigned frames : {0U, 1U, 10U})
    seeds.add(octets(0, node_again, frames, 0x84, 6, 0xB4, 6, bus_poll, 1, 0, image_in_blocks, 2, 9, 0, 255,
                     leaves, channel, 1, object_in_blocks, 31, 9, 0, 0, 255, leaves));
  seeds.add(octets(0, node_again, 63, 0x84, 6, 0x84, 6, trouble, 1, bus_poll, 1, 0, upload, 0, 1, node_again,
                   9, 1, 6, 1, 5, bus_poll, 1, 0));
}

std::vector<Bytes> seeds() {
  Seeds all;
  add_objects(all);
  add_sets(all);
  add_authority(all);
  add_blocks(all);
  add_segments(all);
  add_network(all);
  return all.all;
}

const Register registered({"canopen", run, seeds, nullptr});

}  // namespace
}  // namespace fuzz::canopen_target
