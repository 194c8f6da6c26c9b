// SPDX-License-Identifier: Apache-2.0
#pragma once
// One exchange with the whole firmware library that host and targets both go through, by flexcomp.h and nothing else:
// a set comes in over Modbus RTU, is committed, followed for some cycles, read back and probed; a second one comes
// over CANopen; both buses are asked for what they do not have. Every byte that the library sends, every command that
// it corrects and every state that it reports goes into a transcript. The host prints the CRC-32 of each entry, the targets
// compare.
#include <flexcomp.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "flexcomp/image.hpp"
#include "flexcomp/wire/canopen_objects.hpp"
#include "flexcomp/wire/modbus_map.hpp"
#include "selftest.hpp"

namespace protocol {

namespace co = flexcomp::wire::canopen;
namespace map = flexcomp::wire::modbus;
using flexcomp::wire::Command;

/// What has been sent, one entry after the other: a letter, the length (u16) and the bytes.
struct Transcript {
  std::array<std::uint8_t, 32768> bytes{};
  std::size_t size = 0;
  bool full = false;

  void add(char what, const void* from, std::size_t n) {
    if (n > 0xFFFF || bytes.size() - size < n + 3) {
      full = true;
      return;
    }
    bytes[size] = static_cast<std::uint8_t>(what);
    flexcomp::store_u16(bytes.data() + size + 1, static_cast<std::uint16_t>(n));
    std::memcpy(bytes.data() + size + 3, from, n);
    size += n + 3;
  }

  /// Calls use(entry, bytes) for every entry, letter and length included.
  template <class Use>
  void each(Use use) const {
    for (std::size_t at = 0, n = 0; at < size; at += n) {
      n = 3U + flexcomp::load_u16(bytes.data() + at + 1);
      use(bytes.data() + at, n);
    }
  }
};

constexpr unsigned unit = 17;
constexpr unsigned node = 5;
constexpr std::uint32_t gap_us = 1750;

/// A controller with its memory, two slots in RAM and a driver of each bus that only writes down.
class Exchange {
 public:
  explicit Exchange(Transcript& transcript) : transcript_(transcript) {
    for (auto& slot : slots_) slot.fill(0xFF);
  }
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;

  /// False where the library does not get to the end, whatever it has answered.
  bool run(const flexcomp_robot& robot, const selftest::Image& first) {
    if (!start(robot)) return false;
    flexcomp_can_poll(can_, now_ms_);  // boot-up
    cycles(3);

    read_registers(map::capability, map::capability_registers);
    stage(first);
    command(Command::verify, 0);
    cycles(64);
    read_registers(map::status, map::status_registers);
    command(Command::commit, 0);
    cycles(24);
    read_registers(map::status, map::status_registers);
    read_back(first.size());
    probes();
    const std::uint8_t identify[4] = {0x2B, 0x0E, 1, 0};
    request(identify, sizeof identify);
    not_there();

    selftest::Image second = first;
    flexcomp::store_u32(second.data() + 12, 8);  // the sequence that follows
    const std::size_t body = second.size() - flexcomp::image::crc_bytes;
    flexcomp::store_u32(second.data() + body, flexcomp::crc32(second.data(), body));
    download(co::image, co::image_staging, second.data(), second.size());
    std::uint8_t commit[2] = {static_cast<std::uint8_t>(Command::commit), 0};
    expedited(co::command, co::command_number, commit, sizeof commit);
    cycles(88);
    upload(co::status, 0);
    upload(co::capability, 0);
    upload(co::identity, 4);
    upload(co::image, co::image_active);
    std::uint8_t probe[flexcomp::wire::probe_request_bytes];
    encode(probe_request(1), flexcomp::wire::ByteOrder::little, probe);
    download(co::probe, co::probe_request, probe, sizeof probe);
    upload(co::probe, co::probe_response);
    upload(co::probe, co::probe_flags);
    upload(0x2345, 0);  // no such object
    const std::uint8_t block[8] = {0xC2, 0x10, 0x20, 1, 0, 0, 0, 0};
    flexcomp_can_receive(can_, static_cast<std::uint16_t>(co::sdo_request_id + node), block, sizeof block);
    now_ms_ += 1000;
    flexcomp_can_poll(can_, now_ms_);  // heartbeat

    state();
    const unsigned answer = flexcomp_command(fc_, FLEXCOMP_COMMAND_ROLLBACK);
    const auto said = static_cast<std::uint8_t>(answer);
    transcript_.add('A', &said, 1);
    cycles(88);
    state();
    return start(robot);  // the next power-up finds the first set alone
  }

  /// Slot 0 or 1 of the non-volatile memory.
  const std::array<std::uint8_t, FLEXCOMP_SLOT_BYTES>& slot(unsigned k) const { return slots_[k]; }

 private:
  static flexcomp_storage_result read_slot(void* self, unsigned slot, std::uint32_t offset, std::uint8_t* to,
                                           std::uint32_t size) {
    std::memcpy(to, static_cast<Exchange*>(self)->slots_[slot].data() + offset, size);
    return FLEXCOMP_STORAGE_DONE;
  }
  static flexcomp_storage_result erase_slot(void* self, unsigned slot) {
    static_cast<Exchange*>(self)->slots_[slot].fill(0xFF);
    return FLEXCOMP_STORAGE_DONE;
  }
  static flexcomp_storage_result write_slot(void* self, unsigned slot, std::uint32_t offset,
                                            const std::uint8_t* from, std::uint32_t size) {
    std::memcpy(static_cast<Exchange*>(self)->slots_[slot].data() + offset, from, size);
    return FLEXCOMP_STORAGE_DONE;
  }
  static int send_frame(void* self, std::uint16_t id, const std::uint8_t* bytes, std::uint8_t size) {
    Exchange& e = *static_cast<Exchange*>(self);
    // Identifier, length, bytes; without the zeros at the end, of which confirmations mostly consist.
    std::uint8_t frame[11];
    flexcomp::store_u16(frame, id);
    frame[2] = size;
    std::memcpy(frame + 3, bytes, size);
    unsigned shown = size;
    while (shown != 0 && bytes[shown - 1] == 0) --shown;
    e.transcript_.add('C', frame, shown + 3U);
    std::memset(e.last_frame_.data(), 0, e.last_frame_.size());
    std::memcpy(e.last_frame_.data(), bytes, size);
    return 1;
  }
  static void send_bytes(void* self, const std::uint8_t* bytes, std::size_t size) {
    static_cast<Exchange*>(self)->transcript_.add('R', bytes, size);
  }

  bool start(const flexcomp_robot& robot) {
    flexcomp_settings settings;
    flexcomp_settings_default(&settings);
    settings.cycle_us = 8000;  // a change of set settles within the few cycles that are made
    const flexcomp_storage storage = {this, read_slot, erase_slot, write_slot};
    fc_ = flexcomp_init(&memory_, sizeof memory_, &robot, &settings, &storage);
    if (fc_ == nullptr) return false;
    can_ = flexcomp_can_init(&can_memory_, sizeof can_memory_, fc_, node, 1000, send_frame, this);
    rtu_ = flexcomp_rtu_init(&rtu_memory_, sizeof rtu_memory_, fc_, unit, gap_us, send_bytes, this);
    if (can_ == nullptr || rtu_ == nullptr) return false;
    const auto faults = static_cast<std::uint8_t>(flexcomp_boot(fc_));
    transcript_.add('B', &faults, 1);
    state();
    return true;
  }

  void state() {
    flexcomp_state s;
    flexcomp_get_state(fc_, &s);
    const std::uint32_t words[10] = {s.active_sequence, s.previous_sequence,
                                     s.active_bytes,    s.trial_cycles_left,
                                     s.cycles,          s.detail,
                                     s.store,           s.answer,
                                     s.refusal,         s.faults};
    std::uint8_t bytes[40];
    for (unsigned k = 0; k < 10; ++k) flexcomp::store_u32(bytes + 4 * k, words[k]);
    transcript_.add('S', bytes, sizeof bytes);
  }

  /// Background and cycle for a while; commands in 1/64 rad that move, so that directions are tracked and a change of set settles.
  void cycles(unsigned count) {
    for (unsigned k = 0; k < count; ++k) {
      now_ms_ += 1;
      flexcomp_poll(fc_, now_ms_);
      flexcomp_real q[6];
      for (unsigned i = 0; i < 6; ++i)
        q[i] = static_cast<flexcomp_real>(selftest::commands[1][i] + static_cast<int>(k % 5)) /
               flexcomp_real(64);
      std::uint8_t out[50];
      out[0] = static_cast<std::uint8_t>(flexcomp_step(fc_, q, nullptr, q));
      for (unsigned i = 0; i < 6; ++i) flexcomp::store_u64(out + 1 + 8 * i, flexcomp::to_binary64_bits(q[i]));
      out[49] = static_cast<std::uint8_t>(flexcomp_step_flags(fc_));
      transcript_.add('Q', out, sizeof out);
    }
  }

  flexcomp::wire::ProbeRequest probe_request(std::size_t command) const {
    flexcomp::wire::ProbeRequest r;
    for (std::size_t i = 0; i < 6; ++i) {
      r.q_rad[i] = flexcomp::to_binary64_bits(static_cast<float>(selftest::commands[command][i]) / 64.0F);
      r.direction[i] = flexcomp::to_binary64_bits(i % 2 == 0 ? 1.0F : -1.0F);
    }
    r.payload_kg = flexcomp::to_binary64_bits(0.75F);
    r.payload_com_m[2] = flexcomp::to_binary64_bits(0.0625F);
    r.force_n[0] = flexcomp::to_binary64_bits(12.0F);
    r.temperature_c = flexcomp::to_binary64_bits(25.0F);
    return r;
  }

  // --- Modbus RTU ---------------------------------------------------------------------------------------------

  static void put16(std::uint8_t* to, unsigned v) {
    to[0] = static_cast<std::uint8_t>(v >> 8U);
    to[1] = static_cast<std::uint8_t>(v);
  }

  static unsigned crc16(const std::uint8_t* bytes, std::size_t size) {
    unsigned crc = 0xFFFF;
    for (std::size_t k = 0; k < size; ++k) {
      crc ^= bytes[k];
      for (unsigned b = 0; b < 8; ++b) crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? 0xA001U : 0U);
    }
    return crc;
  }

  void request(const std::uint8_t* pdu, std::size_t size, unsigned spoil = 0) {
    std::uint8_t frame[map::rtu_bytes];
    frame[0] = unit;
    std::memcpy(frame + 1, pdu, size);
    const unsigned crc = crc16(frame, size + 1) ^ spoil;
    frame[size + 1] = static_cast<std::uint8_t>(crc);
    frame[size + 2] = static_cast<std::uint8_t>(crc >> 8U);
    now_us_ += 10000;
    // In two bursts, as a serial driver may see them.
    flexcomp_rtu_receive(rtu_, frame, 3, now_us_);
    flexcomp_rtu_receive(rtu_, frame + 3, size, now_us_ + 200);
    flexcomp_rtu_poll(rtu_, now_us_ + 200 + gap_us);
  }

  void read_registers(unsigned address, unsigned count) {
    std::uint8_t pdu[5] = {3};
    put16(pdu + 1, address);
    put16(pdu + 3, count);
    request(pdu, sizeof pdu);
  }

  void command(Command c, std::uint32_t argument) {
    std::uint8_t pdu[12] = {0x10};
    put16(pdu + 1, map::argument);
    put16(pdu + 3, 3);
    pdu[5] = 6;
    put16(pdu + 6, argument >> 16U);
    put16(pdu + 8, argument & 0xFFFFU);
    put16(pdu + 10, static_cast<unsigned>(c));
    request(pdu, sizeof pdu);
  }

  void stage(const selftest::Image& image) {
    command(Command::begin, static_cast<std::uint32_t>(image.size()));
    constexpr std::size_t most = 2 * (map::most_written - 2);
    for (std::size_t at = 0; at < image.size(); at += most) {
      const std::size_t n = image.size() - at < most ? image.size() - at : most;
      std::uint8_t pdu[map::pdu_bytes] = {0x10};
      put16(pdu + 1, map::staging_offset);
      put16(pdu + 3, static_cast<unsigned>(2 + n / 2));
      pdu[5] = static_cast<std::uint8_t>(4 + n);
      put16(pdu + 6, 0);
      put16(pdu + 8, static_cast<unsigned>(at));
      std::memcpy(pdu + 10, image.data() + at, n);
      request(pdu, 10 + n);
    }
  }

  void read_back(std::size_t size) {
    constexpr std::size_t most = 2 * map::reading_window_registers;
    for (std::size_t at = 0; at < size; at += most) {
      const std::size_t n = size - at < most ? size - at : most;
      std::uint8_t pdu[14] = {0x17};
      put16(pdu + 1, map::reading_window);
      put16(pdu + 3, static_cast<unsigned>(n / 2));
      put16(pdu + 5, map::reading_offset);
      put16(pdu + 7, 2);
      pdu[9] = 4;
      put16(pdu + 10, 0);
      put16(pdu + 12, static_cast<unsigned>(at));
      request(pdu, sizeof pdu);
    }
  }

  void probes() {
    for (std::size_t k = 0; k < selftest::command_count; ++k) {
      std::uint8_t pdu[10 + flexcomp::wire::probe_request_bytes + 2] = {0x17};
      put16(pdu + 1, map::probe_response);
      put16(pdu + 3, map::probe_response_registers + 1);  // with the flags
      put16(pdu + 5, map::probe_request);
      put16(pdu + 7, map::probe_request_registers + 1);
      pdu[9] = flexcomp::wire::probe_request_bytes + 2;
      encode(probe_request(k), flexcomp::wire::ByteOrder::big, pdu + 10);
      put16(pdu + 10 + flexcomp::wire::probe_request_bytes, map::trigger_request);
      request(pdu, sizeof pdu);
    }
  }

  void not_there() {
    read_registers(0x4000, 1);                     // exception 02
    read_registers(map::status, 126);              // exception 03
    command(static_cast<Command>(99), 0);          // exception 04
    const std::uint8_t unknown[2] = {0x55, 0x01};  // exception 01, at the gap
    request(unknown, sizeof unknown);
    const std::uint8_t read[5] = {3, 0, 0, 0, 1};
    request(read, sizeof read, 0x0100);  // a spoilt CRC: silence
  }

  // --- CANopen ------------------------------------------------------------------------------------------------

  void sdo(const std::uint8_t* frame) {
    flexcomp_can_receive(can_, static_cast<std::uint16_t>(co::sdo_request_id + node), frame, 8);
  }

  static void address(std::uint8_t* frame, unsigned index, unsigned sub) {
    flexcomp::store_u16(frame + 1, static_cast<std::uint16_t>(index));
    frame[3] = static_cast<std::uint8_t>(sub);
  }

  void expedited(unsigned index, unsigned sub, const std::uint8_t* bytes, unsigned size) {
    std::uint8_t frame[8] = {static_cast<std::uint8_t>(0x23U | ((4U - size) << 2U))};
    address(frame, index, sub);
    std::memcpy(frame + 4, bytes, size);
    sdo(frame);
  }

  void download(unsigned index, unsigned sub, const std::uint8_t* bytes, std::size_t size) {
    std::uint8_t begin[8] = {0x21};
    address(begin, index, sub);
    flexcomp::store_u32(begin + 4, static_cast<std::uint32_t>(size));
    sdo(begin);
    unsigned toggle = 0;
    for (std::size_t at = 0; at < size; at += 7, toggle ^= 0x10U) {
      const std::size_t n = size - at < 7 ? size - at : 7;
      const unsigned last = at + n == size ? 1U : 0U;
      std::uint8_t frame[8] = {static_cast<std::uint8_t>(toggle | ((7U - n) << 1U) | last)};
      std::memcpy(frame + 1, bytes + at, n);
      sdo(frame);
    }
  }

  void upload(unsigned index, unsigned sub) {
    std::uint8_t frame[8] = {0x40};
    address(frame, index, sub);
    sdo(frame);
    if ((last_frame_[0] & 0xE3U) != 0x41U) return;  // expedited, or an abort
    for (unsigned toggle = 0;; toggle ^= 0x10U) {
      const std::uint8_t next[8] = {static_cast<std::uint8_t>(0x60U | toggle)};
      sdo(next);
      if ((last_frame_[0] & 0xE0U) != 0 || (last_frame_[0] & 1U) != 0) return;
    }
  }

  Transcript& transcript_;
  std::array<std::array<std::uint8_t, FLEXCOMP_SLOT_BYTES>, 2> slots_{};
  flexcomp_memory memory_{};
  flexcomp_can_memory can_memory_{};
  flexcomp_rtu_memory rtu_memory_{};
  flexcomp_arm* fc_ = nullptr;
  flexcomp_can* can_ = nullptr;
  flexcomp_rtu* rtu_ = nullptr;
  std::array<std::uint8_t, 8> last_frame_{};
  std::uint32_t now_ms_ = 0;
  std::uint32_t now_us_ = 0;
};

}  // namespace protocol
