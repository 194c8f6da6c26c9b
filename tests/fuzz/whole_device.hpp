// SPDX-License-Identifier: Apache-2.0
/// \file
/// A whole controller behind the C interface, with a flash memory that fails, two slots, a CANopen node, a serial line and
/// three TCP connections: what the targets of the firmware play with, and what must hold after each operation.
#pragma once

#include <array>
#include <memory>

#include "flexcomp.h"
#include "flexcomp/image.hpp"
#include "flexcomp/signature.hpp"
#include "flexcomp/wire/canopen_objects.hpp"
#include "flexcomp/wire/certificate_record.hpp"
#include "flexcomp/wire/store_state.hpp"
#include "flexcomp/wire/unit_record.hpp"
#include "fuzz.hpp"

namespace fuzz {

constexpr double most_rad = 2.2;  ///< joint limits of the arm, both ways
constexpr unsigned node_id = 5;   ///< on CANopen
constexpr unsigned unit_id = 17;  ///< on Modbus
constexpr char serial[] = "fuzzed arm 5";

using FirmwareScalar = flexcomp_real;
using FirmwareTerm = flexcomp::Term<FirmwareScalar>;

/// Staubli TX60L with a tool, as in Chen et al. 2019.
inline flexcomp_robot arm_of_the_paper() {
  constexpr double degree = 3.14159265358979323846 / 180;
  const double table[6][4] = {{0, 0, 0, -90},   {-90, 0, 400, 0}, {90, 20, 0, 90},
                              {0, 450, 0, -90}, {0, 0, 0, 90},    {0, 70, 0, 0}};
  flexcomp_robot robot;
  flexcomp_robot_default(&robot);
  robot.name = "fuzzed";
  for (int j = 0; j < 6; ++j) {
    robot.links[j] = {table[j][0] * degree, table[j][1] * 1e-3, table[j][2] * 1e-3, table[j][3] * degree, 0};
    robot.min_rad[j] = -most_rad;
    robot.max_rad[j] = most_rad;
  }
  robot.tool_xyz_m[0] = 0.01;
  robot.tool_xyz_m[1] = 0.03;
  robot.tool_xyz_m[2] = 0.06;
  robot.payload_kg = 1.1;
  robot.payload_com_m[2] = 0.06;
  return robot;
}

/// What an image must say to be for this arm.
inline flexcomp::ImageHeader binding() {
  const flexcomp_robot robot = arm_of_the_paper();
  flexcomp::NominalRobot<6> nominal;
  for (std::size_t j = 0; j < 6; ++j) {
    const flexcomp_link& link = robot.links[j];
    nominal.links[j] = {link.theta_rad, link.d_m, link.a_m, link.alpha_rad, link.beta_rad};
  }
  flexcomp::ImageHeader header;
  header.nominal_hash = flexcomp::nominal_hash(nominal);
  header.name_hash = flexcomp::name_hash(robot.name, std::strlen(robot.name));
  return header;
}

/// `is_bound`: to this unit.
inline Bytes image_of(const std::vector<FirmwareTerm>& terms, const std::vector<flexcomp::Table>& tables,
                      const std::vector<FirmwareScalar>& values, std::uint32_t sequence,
                      bool is_bound = false) {
  static const flexcomp::ImageHeader bound = binding();
  flexcomp::ImageHeader header = bound;
  header.sequence = sequence;
  if (is_bound) header.unit_hash = flexcomp::name_hash(serial, std::strlen(serial));
  const flexcomp::TermList<FirmwareScalar> list{terms.data(),  terms.size(),  tables.data(),
                                                tables.size(), values.data(), values.size()};
  Bytes out(flexcomp::image_size(list, is_bound));
  if (flexcomp::encode_image(list, header, out.data(), out.size()) == 0) finding("a seed that is no image");
  return out;
}

constexpr unsigned image_count = 7;

/// Sets that are admitted: empty, geometry, loads, a curve and a wave, a grid, a bit of all; and one that costs too much.
inline Bytes good_image(unsigned number, std::uint32_t sequence, bool is_bound = false) {
  using flexcomp::Basis;
  std::vector<FirmwareTerm> terms;
  std::vector<flexcomp::Table> tables;
  std::vector<FirmwareScalar> values;
  const auto add = [&terms](unsigned body, unsigned slot, Basis basis, unsigned joint,
                            double coefficient) -> FirmwareTerm& {
    FirmwareTerm term;
    term.place = {static_cast<std::uint8_t>(body), static_cast<std::uint8_t>(slot)};
    term.basis = basis;
    term.joint = static_cast<std::uint8_t>(joint);
    term.coefficient = static_cast<FirmwareScalar>(coefficient);
    terms.push_back(term);
    return terms.back();
  };
  number %= image_count;
  const bool all = number == 5;
  if (number == 1 || all) {
    for (unsigned link = 1; link <= 6; ++link) {
      for (unsigned slot = 0; slot < 5; ++slot) add(link, slot, Basis::one, 0, 1e-4 * (link + slot));
    }
    add(flexcomp::body::tool, 0, Basis::one, 0, 1e-4);
    add(flexcomp::body::base, 5, Basis::one, 0, 1e-4);
  }
  if (number == 2 || all) {
    for (unsigned joint = 0; joint < 6; ++joint) add(joint + 1, 0, Basis::load_torque, joint, 1e-5);
    add(2, 0, Basis::load_torque_cubed, 1, 1e-10);
    add(2, 0, Basis::link_weight, 1, 1e-4).distal_joint = 2;
    add(3, 3, Basis::load_moment_x, 2, 1e-6);
    add(flexcomp::body::base, 3, Basis::base_moment_x, 0, 1e-7).argument = FirmwareScalar(-0.4F);
    add(2, 2, Basis::thermal, 0, 1e-5);
    add(flexcomp::body::load, 0, Basis::one, 0, 0.05);
  }
  if (number == 3 || all) {
    add(3, 0, Basis::sine, 2, 1e-4).argument = 1;
    add(3, 0, Basis::cosine, 2, 1e-4).argument = 2;
    add(2, 0, Basis::direction, 1, 5e-5);
    add(4, 0, Basis::joint_position, 3, 1e-4);
    FirmwareTerm& curve = add(3, 0, Basis::curve, 2, 1);
    curve.table = static_cast<std::uint16_t>(tables.size());
    flexcomp::Table table;
    table.size = 8;
    for (int k = 0; k < 8; ++k) values.push_back(static_cast<FirmwareScalar>(1e-4 * (k % 3)));
    tables.push_back(table);
  }
  if (number == 4 || all) {
    FirmwareTerm& grid = add(2, 0, Basis::grid, 1, 1);
    grid.table = static_cast<std::uint16_t>(tables.size());
    grid.effect = flexcomp::Effect::unnamed;
    flexcomp::Table table;
    table.offset = static_cast<std::uint16_t>(values.size());
    table.rows = 3;
    table.columns = 2;
    table.row_joint = 1;
    table.column_covariate = flexcomp::Covariate::payload;
    for (const double v : {-1.0, 0.0, 1.0, 0.0, 5.0, 0.0, 1e-4, 1e-4, 2e-4, 0.0, 1e-4})
      values.push_back(static_cast<FirmwareScalar>(v));
    table.size = 11;
    tables.push_back(table);
  }
  if (number == 6) {
    for (unsigned k = 0; k < 60; ++k)
      add(1 + k % 6, k % 5, k % 2 == 0 ? Basis::sine : Basis::load_moment_x, k % 6, 1e-7).argument =
          static_cast<FirmwareScalar>(1 + k / 6);
  }
  return image_of(terms, tables, values, sequence, is_bound);
}

// --- signatures --------------------------------------------------------------------------------------------

/// Public keys. The signature of a message is its SHA-256 with the key before it: what the library does before and after
/// Ed25519 is fuzzed, not Ed25519, which is the integrator's.
constexpr unsigned key_count = 3;
inline const std::uint8_t (*public_keys())[32] {
  static std::uint8_t keys[key_count][32];
  for (unsigned k = 0; k < key_count; ++k) std::fill(keys[k], keys[k] + 32, static_cast<std::uint8_t>(k + 1));
  return keys;
}
inline std::array<std::uint8_t, 64> signature_of_message(const std::uint8_t* key,
                                                         const std::uint8_t* message) {
  flexcomp::Sha256 sha;
  for (std::size_t k = 0; k < flexcomp::signing::key_bytes; ++k) sha.update(key[k]);
  for (std::size_t k = 0; k < flexcomp::signing::message_bytes; ++k) sha.update(message[k]);
  const flexcomp::Sha256Digest digest = sha.finish();
  std::array<std::uint8_t, 64> signature{};
  std::copy(digest.begin(), digest.end(), signature.begin());
  std::copy(digest.begin(), digest.end(), signature.begin() + 32);
  signature[63] &= 0x0FU;  // canonical
  return signature;
}
inline std::array<std::uint8_t, 64> sign(flexcomp::Signed what, const std::uint8_t* bytes, std::size_t end,
                                         unsigned key) {
  return signature_of_message(public_keys()[key],
                              flexcomp::signed_message(what, flexcomp::sha256(bytes, end)).data());
}
/// The signature record, and the CRC-32, are written anew.
inline void mend_signature(Bytes& image, unsigned key) {
  if (image.size() < flexcomp::image::header_bytes + 88 + flexcomp::image::crc_bytes) return;
  const auto signature =
      sign(flexcomp::Signed::set, image.data(), flexcomp::signature_offset(image.size()), key);
  flexcomp::put_signature(image.data(), image.size(), signature.data());
}
inline Bytes signed_image(Bytes image, std::uint64_t counter, unsigned key) {
  const std::size_t size = image.size();
  image.resize(flexcomp::signed_size(size));
  flexcomp::append_signature(image.data(), size, counter, flexcomp::key_id(public_keys()[key]));
  mend_signature(image, key);
  return image;
}

/// Writes the CRC-32 of an image anew.
inline void mend_crc(Bytes& image) {
  if (image.size() < 4) return;
  flexcomp::store_u32(image.data() + image.size() - 4, flexcomp::crc32(image.data(), image.size() - 4));
}

inline std::uint16_t modbus_crc_of(const Bytes& bytes) {
  unsigned crc = 0xFFFF;
  for (const unsigned byte : bytes) {
    crc ^= byte;
    for (int k = 0; k < 8; ++k) crc = (crc & 1U) != 0 ? crc >> 1U ^ 0xA001U : crc >> 1U;
  }
  return static_cast<std::uint16_t>(crc);
}

/// What comes into the middle of a block transfer: the frame before its segment or sub-block of this number.
struct Disturbance {
  unsigned before = 0xFFFF;
  Bytes frame;                ///< empty: the transfer ends there
  unsigned milliseconds = 0;  ///< that pass
  bool repeats = false;       ///< the frame is the one that went out last
  bool pushes = false;        ///< another set becomes active meanwhile

  static Disturbance from(Input& input) {
    Disturbance by;
    by.before = input.u8();
    const unsigned how = input.u8();
    by.repeats = (how & 1U) != 0;
    by.pushes = (how & 2U) != 0;
    if ((how & 4U) != 0) by.milliseconds = input.u16();
    if ((how & 8U) == 0) by.frame = input.bytes(8);
    return by;
  }
};

/// The controller and its world.
class Device {
 public:
  /// `start`: bits 0, 1: so many sets in the flash; bit 2: pass-through; bit 3: a cycle of a second, after which nothing holds
  /// a correction back any more; bit 4: without hooks; bits 5, 6: 1 a key is trusted, 2 two keys, 3 only a serial number;
  /// bit 7: nothing keeps what a CAN master has set up, and bytes of the serial line come in bursts.
  explicit Device(unsigned start) : start_(start) {
    flash_ = flash_with(start & 3U, trusted() != 0);
    // A device that authorises everything needs no signed command.
    if (trusted() != 0) allowed_ = 0xFFFF;
    power_on();
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  // --- power and flash ---------------------------------------------------------------------------------

  /// Everything but the flash is lost; so many hooks of the start fail.
  void power_on(unsigned failing = 0) {
    is_dead_ = false;
    is_placed_ = false;
    power_left_ = -1;
    fail_next_ = 0;
    busy_next_ = 0;
    refused_frames_ = 0;
    std::memset(memory_.arm.get(), 0xA5, FLEXCOMP_MEMORY_BYTES);
    flexcomp_settings settings;
    flexcomp_settings_default(&settings);
    settings.trial_cycles = 20;
    if ((start_ & 4U) != 0) settings.on_refusal = FLEXCOMP_PASS_THROUGH;
    if ((start_ & 8U) != 0) settings.cycle_us = 1000000;
    const flexcomp_storage storage{this, read_slot, erase_slot, write_slot};
    flexcomp_robot robot = arm_of_the_paper();
    if ((start_ & 0x60U) != 0) robot.serial = serial;
    arm_ = flexcomp_init(memory_.arm.get(), FLEXCOMP_MEMORY_BYTES, &robot, &settings, &storage);
    require(arm_ != nullptr, "init refused a good robot");
    const flexcomp_hooks hooks{this, permit, log};
    if ((start_ & 16U) == 0) flexcomp_set_hooks(arm_, &hooks);
    if (trusted() != 0) {
      const flexcomp_trust trust{this, public_keys(), trusted(), check_signature};
      require(flexcomp_set_trust(arm_, &trust) == 1, "keys are not taken");
    }
    fail_next_ = failing;
    fail_after_ = 0;
    flexcomp_boot(arm_);
    fail_next_ = 0;
    slow_checks_ = 0;
    can_ = flexcomp_can_init(memory_.can.get(), FLEXCOMP_CAN_BYTES, arm_, node_id, 100, send_frame, this);
    rtu_ = flexcomp_rtu_init(memory_.rtu.get(), FLEXCOMP_RTU_BYTES, arm_, unit_id,
                             (start_ & 0x80U) == 0 ? 1750 : 20000, send_rtu, this);
    require(can_ != nullptr && rtu_ != nullptr, "init of a bus failed");
    if ((start_ & 0x80U) == 0) flexcomp_can_set_memory(can_, load_can, save_can, this);
    require(flexcomp_can_set_channel(can_, channel_request, channel_answer) != 0, "no second channel");
    for (std::size_t k = 0; k < tcp_.size(); ++k) {
      tcp_[k] = flexcomp_tcp_init(memory_.tcp[k].get(), FLEXCOMP_TCP_BYTES, arm_, unit_id, send_tcp, this);
      require(tcp_[k] != nullptr, "init of a connection failed");
    }
    seen_crc_ = 0;
    counter_ = 0;
    check_active();
    if (failing == 0) {
      require(checks_ > 6 || counter_ >= told_counter_, "a counter that a start has told came back");
      told_counter_ = std::max(told_counter_, counter_);
    }
    ++checks_;  // a start may use a place of the memory, too
  }
  /// Keys that are trusted.
  unsigned trusted() const { return (start_ >> 5U & 3U) % 3U; }
  /// A good set for this device: signed where it trusts keys, with its sequence as counter.
  Bytes image(unsigned number, std::uint32_t sequence, unsigned key = 0) const {
    if (trusted() == 0) return good_image(number, sequence, (start_ & 0x60U) != 0);
    return signed_image(good_image(number, sequence, true), sequence, key);
  }
  /// A signed command for the set that is active.
  Bytes signed_command(unsigned command, std::uint64_t counter, unsigned key) {
    Bytes bytes(flexcomp::signing::command_bytes);
    flexcomp::SignedCommand c;
    c.command = static_cast<std::uint16_t>(command);
    c.active_crc = word(registers(0x0040, 48), 24);
    c.counter = counter;
    c.unit_hash = flexcomp::name_hash(serial, std::strlen(serial));
    c.key_id = flexcomp::key_id(public_keys()[key]);
    flexcomp::encode(c, bytes.data());
    mend_command(bytes, key);
    return bytes;
  }
  static void mend_command(Bytes& bytes, unsigned key) {
    const auto signature =
        sign(flexcomp::Signed::command, bytes.data(), flexcomp::signing::command_signature, key);
    std::copy(signature.begin(), signature.end(),
              bytes.begin() + static_cast<std::ptrdiff_t>(flexcomp::signing::command_signature));
    mend_crc(bytes);
  }
  /// The function that checks signatures wants so many more calls.
  void slow_checks(unsigned count) { slow_checks_ = count; }
  /// A byte of the flash has changed while the power was off.
  void spoil(unsigned slot, std::uint32_t offset, unsigned by) {
    std::uint8_t& byte = flash_[slot % 2][offset % FLEXCOMP_SLOT_BYTES];
    byte = static_cast<std::uint8_t>(byte ^ by);
    told_counter_ = 0;
    power_on();
  }
  /// The storage hooks fail, or are busy, so many times from now, or after so many calls that go well.
  void fail_storage(unsigned times, unsigned after = 0) {
    fail_next_ = times;
    fail_after_ = after;
  }
  void busy_storage(unsigned times) { busy_next_ = times; }
  /// The power goes after so many more bytes have been programmed or erased.
  void cut_power_after(std::uint32_t bytes) { power_left_ = static_cast<std::int64_t>(bytes); }
  void allow(unsigned commands) { allowed_ = commands; }

  // --- cycle -------------------------------------------------------------------------------------------

  using Joints = std::array<flexcomp_real, 6>;

  void step(const Joints& q, const flexcomp_context* context) {
    Joints out;
    out.fill(std::numeric_limits<flexcomp_real>::quiet_NaN());
    const flexcomp_status status = flexcomp_step(arm_, q.data(), context, out.data());
    check_step(status, out);
  }
  void step_rate(const Joints& q, const Joints& rate, const flexcomp_context* context) {
    Joints out;
    Joints out_rate;
    out.fill(std::numeric_limits<flexcomp_real>::quiet_NaN());
    out_rate = out;
    const flexcomp_status status =
        flexcomp_step_rate(arm_, q.data(), rate.data(), context, out.data(), out_rate.data());
    check_step(status, out);
    for (const flexcomp_real v : out_rate) require(std::isfinite(v), "a rate that is not finite left a step");
  }
  /// What is computed beside the step, with the same readings.
  void readings(const Joints& q, const flexcomp_context* context) {
    Joints a;
    Joints b;
    a.fill(0);
    b.fill(0);
    if (flexcomp_uncorrect(arm_, q.data(), context, a.data()) != 0) require_finite(a, "uncorrect");
    std::array<flexcomp_real, 3> xyz{};
    std::array<flexcomp_real, 4> wxyz{{1, 0, 0, 0}};
    if (flexcomp_tool_pose(arm_, q.data(), context, xyz.data(), wxyz.data()) != 0) {
      require_finite(xyz, "tool_pose");
      require_finite(wxyz, "tool_pose");
      flexcomp_real norm = 0;
      for (const flexcomp_real v : wxyz) norm += v * v;
      require(std::abs(norm - 1) < 1e-3F && wxyz[0] >= 0, "a quaternion of norm other than 1, or w below 0");
    }
    if (flexcomp_joint_loads(arm_, q.data(), context, a.data(), b.data()) != 0) {
      require_finite(a, "joint_loads");
      require_finite(b, "joint_loads");
    }
  }
  void ordinary_steps(unsigned count) {
    for (unsigned k = 0; k < count; ++k) {
      // Within the limits, in all directions, standing still now and then.
      Joints q;
      for (std::size_t j = 0; j < 6; ++j)
        q[j] = static_cast<flexcomp_real>(
            1.5 * std::sin(0.002 * static_cast<double>(at_) + static_cast<double>(j)));
      if (at_++ % 7 != 0) ++at_;
      step(q, nullptr);
    }
  }
  int start(const Joints& q) {
    const int taken = flexcomp_start(arm_, q.data());
    if (taken != 0) is_placed_ = true;
    return taken;
  }

  // --- background --------------------------------------------------------------------------------------

  void poll(std::uint32_t ms) {
    now_ms_ += ms;
    flexcomp_poll(arm_, now_ms_);
    check_state();
  }
  /// Polls and cycles until the store no longer works.
  void settle() {
    for (int k = 0; k < 2000; ++k) {
      flexcomp_state state;
      flexcomp_get_state(arm_, &state);
      if (state.store != 3 || is_dead_) break;
      flexcomp_poll(arm_, ++now_ms_);
      if (k % 4 == 3) ordinary_steps(1);
    }
    check_state();
  }
  flexcomp_state state() const {
    flexcomp_state s;
    flexcomp_get_state(arm_, &s);
    return s;
  }
  flexcomp_arm* arm() { return arm_; }

  /// A whole set by the C interface; the answer.
  unsigned push(const Bytes& image) {
    unsigned answer = flexcomp_stage_begin(arm_, static_cast<std::uint32_t>(image.size()));
    if (answer == 0)
      answer = flexcomp_stage_write(arm_, 0, image.data(), static_cast<std::uint32_t>(image.size()));
    if (answer == 0) answer = flexcomp_stage_commit(arm_);
    if (answer != 0) return answer;
    settle();
    return state().answer;
  }

  // --- buses -------------------------------------------------------------------------------------------

  void frame(unsigned id, const Bytes& bytes) {
    flexcomp_can_receive(can_, static_cast<std::uint16_t>(id), bytes.data(), bytes.size());
  }
  void can_poll(std::uint32_t ms) {
    now_ms_ += ms;
    flexcomp_can_poll(can_, now_ms_);
  }
  void refuse_frames(unsigned count) { refused_frames_ = count; }
  /// Another node in the same memory, with sub-blocks of so many frames, and with this second channel.
  void again_can(unsigned frames = 63, unsigned request_id = 0, unsigned answer_id = 0) {
    std::memset(memory_.can.get(), 0x5A, FLEXCOMP_CAN_BYTES);
    can_ = flexcomp_can_init(memory_.can.get(), FLEXCOMP_CAN_BYTES, arm_, node_id, 0, send_frame, this);
    flexcomp_can_set_block_size(can_, frames);
    const bool is_open = flexcomp_can_set_channel(can_, request_id, answer_id) != 0;
    require(flexcomp_can_channel(can_) == (is_open ? request_id : 0U), "a channel that was refused is open");
  }
  /// What the memory of the node holds is another byte from the next reset on.
  void spoil_can(unsigned at, unsigned value) { can_record_[at % 8] = static_cast<std::uint8_t>(value); }
  /// Over which of the two SDO servers what follows goes.
  void use_channel(bool is_second) { is_second_ = is_second; }
  /// An SDO request; the answer, empty where there is none.
  Bytes sdo(const Bytes& request) {
    answer_.clear();
    Bytes eight = request;
    eight.resize(8);
    last_request_ = eight;
    frame(is_second_ ? channel_request : 0x600U + node_id, eight);
    return answer_;
  }
  /// Download of an object by segments, or expedited: true where no answer was an abort.
  bool download(unsigned index, unsigned sub, const Bytes& bytes, bool announces) {
    Output begin;
    if (bytes.size() <= 4 && !bytes.empty()) {
      begin.u8(0x23U | (4U - static_cast<unsigned>(bytes.size())) << 2U).u16(index).u8(sub).add(bytes);
      const Bytes answer = sdo(begin.out);
      return answer.size() == 8 && answer[0] == 0x60;
    }
    begin.u8(announces ? 0x21U : 0x20U).u16(index).u8(sub);
    if (announces) begin.u32(static_cast<std::uint32_t>(bytes.size()));
    Bytes answer = sdo(begin.out);
    unsigned toggle = 0;
    for (std::size_t at = 0; at < bytes.size();) {
      if (answer.size() != 8 || (answer[0] != 0x60 && (answer[0] & 0xEFU) != 0x20)) return false;
      const std::size_t n = std::min<std::size_t>(7, bytes.size() - at);
      Bytes segment(
          1, static_cast<std::uint8_t>(toggle << 4U | (7U - n) << 1U | (at + n == bytes.size() ? 1U : 0U)));
      segment.insert(segment.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at),
                     bytes.begin() + static_cast<std::ptrdiff_t>(at + n));
      answer = sdo(segment);
      toggle ^= 1U;
      at += n;
    }
    return answer.size() == 8 && (answer[0] & 0xEFU) == 0x20;
  }
  /// True where the transfer goes on.
  bool disturb(const Disturbance& by, unsigned at) {
    if (at != by.before) return true;
    if (by.milliseconds != 0) can_poll(by.milliseconds);
    if (by.pushes) {
      push(image(1, state().active_sequence + 1));
      ordinary_steps(3);
    }
    if (by.repeats) sdo(last_request_);
    if (!by.frame.empty()) sdo(by.frame);
    return by.repeats || by.pushes || !by.frame.empty();
  }
  /// Block download of an object (CiA 301, 7.2.4.3.9); `wrong` changes its CRC.
  void block_download(unsigned index, unsigned sub, const Bytes& bytes, unsigned wrong,
                      const Disturbance& by = {}) {
    Bytes answer =
        sdo(Output().u8(0xC6).u16(index).u8(sub).u32(static_cast<std::uint32_t>(bytes.size())).out);
    unsigned crc = wrong;
    for (const unsigned byte : bytes) {
      crc ^= byte << 8U;
      for (int k = 0; k < 8; ++k)
        crc = (crc & 0x8000U) != 0 ? (crc << 1U ^ 0x1021U) & 0xFFFFU : crc << 1U & 0xFFFFU;
    }
    std::size_t at = 0;
    unsigned segments = 0;
    while (at < bytes.size()) {
      if (answer.size() != 8 || (answer[0] & 0xE0U) != 0xA0) return;
      const unsigned most = answer[0] == 0xA2 ? answer[2] : answer[4];
      for (unsigned number = 1; number <= most && at < bytes.size(); ++number, at += 7) {
        const std::size_t n = std::min<std::size_t>(7, bytes.size() - at);
        const auto from = bytes.begin() + static_cast<std::ptrdiff_t>(at);
        if (!disturb(by, segments++)) return;
        answer = sdo(Output()
                         .u8(number | (at + n == bytes.size() ? 0x80U : 0U))
                         .add(Bytes(from, from + static_cast<std::ptrdiff_t>(n)))
                         .out);
      }
    }
    if (answer.size() != 8 || answer[0] != 0xA2 || !disturb(by, 0xFF)) return;
    const Bytes end = Output().u8(0xC1U | static_cast<unsigned>(at - bytes.size()) << 2U).u16(crc).out;
    sdo(end);
    if ((wrong & 1U) != 0) sdo(end);  // where its answer was lost
  }
  /// Block upload of an object, of which all but so many segments of a sub-block are said to have arrived.
  void block_upload(unsigned index, unsigned sub, unsigned most, unsigned lost, unsigned switch_to = 0,
                    const Disturbance& by = {}) {
    Bytes answer = sdo(Output().u8(0xA4).u16(index).u8(sub).u8(most).u8(switch_to).out);
    if (answer.size() != 8 || (answer[0] & 0xE0U) != 0xC0 || !disturb(by, 0xFF)) return;
    answer = sdo({0xA3});
    for (unsigned blocks = 0; blocks < 40; ++blocks) {
      if (!disturb(by, blocks)) return;
      for (int k = 0; k < 4; ++k) can_poll(1);
      if (answer_.size() != 8) return;
      const unsigned number = answer_[0] & 0x7FU;
      // Sizes of sub-blocks alternate, so that a copy is known.
      const unsigned next = most > 1 && blocks % 2 == 0 ? most - 1 : most;
      answer = sdo(Output().u8(0xA2).u8(number > lost ? number - lost : 0).u8(next).out);
      if (answer.size() == 8 && (answer[0] & 0xE3U) == 0xC1) {
        if (disturb(by, 0xFE)) sdo({0xA1});
        return;
      }
      lost = 0;
    }
  }
  /// Upload of an object, at most so many segments of it.
  void upload(unsigned index, unsigned sub, unsigned most) {
    Bytes answer = sdo(Output().u8(0x40).u16(index).u8(sub).out);
    if (answer.size() != 8 || (answer[0] & 0xE2U) != 0x40) return;
    unsigned toggle = 0;
    for (; most != 0; --most) {
      answer = sdo({static_cast<std::uint8_t>(0x60U | toggle << 4U)});
      if (answer.size() != 8 || (answer[0] & 0xE0U) != 0 || (answer[0] & 1U) != 0) return;
      toggle ^= 1U;
    }
  }

  void rtu(const Bytes& bytes, std::uint32_t us) {
    now_us_ += us;
    flexcomp_rtu_receive(rtu_, bytes.data(), bytes.size(), now_us_);
  }
  void rtu_frame(unsigned unit, const Bytes& pdu, std::uint32_t us) {
    Bytes all(1, static_cast<std::uint8_t>(unit));
    all.insert(all.end(), pdu.begin(), pdu.end());
    const unsigned crc = modbus_crc_of(all);
    rtu(Output().add(all).u16(crc).out, us);
  }
  void rtu_poll(std::uint32_t us) {
    now_us_ += us;
    flexcomp_rtu_poll(rtu_, now_us_);
  }
  void rtu_line_error(bool overrun) { flexcomp_rtu_line_error(rtu_, overrun ? 1 : 0); }

  static constexpr std::size_t connections = 2;  ///< that a target may use; the third one watches

  void tcp(std::size_t k, const Bytes& bytes) {
    if (flexcomp_tcp_receive(tcp_[k], bytes.data(), bytes.size()) == 0) {
      // The program closes such a connection, and nothing more may come out of it.
      answer_.clear();
      require(flexcomp_tcp_receive(tcp_[k], bytes.data(), bytes.size()) == 0 && answer_.empty(),
              "a broken connection came back");
      tcp_reset(k);
    }
  }
  void tcp_reset(std::size_t k) { flexcomp_tcp_reset(tcp_[k]); }
  void tcp_init(std::size_t k) {
    tcp_[k] = flexcomp_tcp_init(memory_.tcp[k].get(), FLEXCOMP_TCP_BYTES, arm_, unit_id, send_tcp, this);
  }
  /// One request on a stream that is in step; the PDU of the answer. It must be the answer to this request.
  Bytes ask(std::size_t k, const Bytes& pdu) {
    if (pdu.empty() || pdu.size() > 253) return {};
    const unsigned transaction = ++transaction_ & 0xFFFFU;
    Output frame;
    frame.u8(transaction >> 8U).u8(transaction & 0xFFU).u16(0).u8(0);
    frame.u8(static_cast<unsigned>(pdu.size()) + 1).u8(unit_id).add(pdu);
    answer_.clear();
    answers_ = 0;
    require(flexcomp_tcp_receive(tcp_[k], frame.out.data(), frame.out.size()) == 1,
            "a good frame broke a connection");
    require(answers_ == 1, "not one answer to one request");
    require(answer_[0] == transaction >> 8U && answer_[1] == (transaction & 0xFFU) && answer_[6] == unit_id,
            "the answer is to another transaction or of another unit");
    require((answer_[7] & 0x7FU) == (pdu[0] & 0x7FU), "the answer is to another function");
    if (answer_[7] != pdu[0] || (pdu[0] & 0x80U) != 0) {
      require(answer_.size() == 9 && answer_[8] >= 1 && answer_[8] <= 6, "no exception of Modbus");
    }
    return {answer_.begin() + 7, answer_.end()};
  }

  // --- what must hold ----------------------------------------------------------------------------------

  void check_state() {
    if (is_dead_) return;
    const flexcomp_state s = state();
    require(
        std::strcmp(flexcomp::wire::name(static_cast<flexcomp::wire::StoreState>(s.store)), "unknown") != 0,
        "a state that the protocol does not have");
    require(s.faults <= 15, "a fault that the protocol does not have");
    require(s.active_bytes <= FLEXCOMP_STAGING_BYTES, "an active set longer than its memory");
    require((s.active_sequence == 0) || (s.active_bytes != 0), "a sequence without a set");
    require(std::strncmp(flexcomp_answer_text(s.answer), "unknown answer", 14) != 0,
            "an answer without a text");
    require(std::strncmp(flexcomp_refusal_text(s.refusal), "unknown", 7) != 0, "a refusal without a text");
  }

  /// The active set, read back over a bus, is a whole image of this arm with its CRC, and it is the one that the status
  /// record names. Storage does not fail meanwhile.
  void check_active() {
    check_state();
    if (is_dead_) return;
    const unsigned failing = fail_next_;
    fail_next_ = 0;
    const Bytes status = registers(0x0040, 48);
    const flexcomp_state s = state();
    const bool is_active = status[12] != 0xFF;
    const std::uint32_t crc = word(status, 24);
    require(word(status, 16) == s.active_sequence && word(status, 20) == s.active_bytes,
            "status record and C interface differ");
    require(is_active == (s.active_bytes != 0), "an active set without bytes, or bytes without a set");
    // Reading is slow: the same set need not be read twice. While rollback and restore erase its slot it cannot be read.
    if (is_active && s.store != 3 && (crc != seen_crc_ || crc == 0)) {
      Bytes image(s.active_bytes);
      for (std::size_t at = 0; at < image.size(); at += 246) {
        const std::size_t size = std::min<std::size_t>(246, image.size() - at);
        ask(connections, Output().u8(6).u8(2).u8(0).u16(0).out);
        ask(connections, Output().u8(6).u8(2).u8(1).u8(static_cast<unsigned>(at >> 8U)).u8(at & 0xFFU).out);
        const Bytes part = registers(0x0202, static_cast<unsigned>(size + 1) / 2);
        require(part.size() >= size, "the active set cannot be read");
        std::copy_n(part.begin(), size, image.begin() + static_cast<std::ptrdiff_t>(at));
      }
      static const flexcomp::ImageHeader bound = binding();
      flexcomp::ImageHeader header;
      require(flexcomp::check_image(image.data(), image.size(), bound.nominal_hash, bound.name_hash,
                                    header) == flexcomp::Refusal::none,
              "the active set is no whole image of this arm");
      require(header.sequence == s.active_sequence, "the active set has another sequence");
      require(flexcomp::load_u32(image.data() + image.size() - 4) == crc, "the active set has another CRC");
      if (trusted() != 0) check_signed(image);
      check_certificate();
      seen_crc_ = crc;
    }
    if (!is_active) seen_crc_ = 0;
    namespace wire = flexcomp::wire;
    const Bytes told = registers(wire::modbus::unit, wire::modbus::unit_registers);
    wire::UnitRecord unit;
    wire::decode(told.data(), wire::ByteOrder::big, unit);
    require(unit.keys == trusted() && unit.counter >= counter_, "other keys, or the counter went back");
    counter_ = unit.counter;
    fail_next_ = failing;
  }
  /// The certificate is read as it is written.
  void check_certificate() {
    namespace wire = flexcomp::wire;
    const Bytes told = registers(wire::modbus::certificate, wire::modbus::certificate_registers);
    wire::CertificateRecord record;
    wire::decode(told.data(), wire::ByteOrder::big, record);
    Bytes again(told.size());
    wire::encode(record, wire::ByteOrder::big, again.data());
    require(again == told, "a certificate that is not read as it is written");
  }
  /// The active set of a device that trusts keys is bound to this unit, and one of them has signed it.
  void check_signed(const Bytes& image) const {
    using namespace flexcomp;
    const Sha256Digest unit = name_hash(serial, std::strlen(serial));
    const std::uint8_t* bound = bound_unit(image.data(), image.size());
    require(bound != nullptr && std::equal(unit.begin(), unit.end(), bound),
            "the active set is not bound to this unit");
    const std::uint8_t* record = signature_of(image.data(), image.size());
    require(record != nullptr, "the active set is not signed");
    bool is_known = false;
    for (unsigned key = 0; key < trusted(); ++key) {
      const auto good = sign(Signed::set, image.data(), signature_offset(image.size()), key);
      is_known = is_known || std::equal(good.begin(), good.end(), record + signing::record_signature);
    }
    require(is_known, "the active set is signed by nobody");
  }

  /// At the end of every operation.
  void end_of_operation() {
    if (is_dead_) power_on();
    check_state();
  }

 private:
  static constexpr unsigned channel_request = flexcomp::wire::canopen::channel_request_id + node_id;
  static constexpr unsigned channel_answer = flexcomp::wire::canopen::channel_answer_id + node_id;
  using Slots = std::array<std::array<std::uint8_t, FLEXCOMP_SLOT_BYTES>, 2>;
  /// Blocks of exactly the sizes that flexcomp.h names, so that a sanitizer sees their ends.
  struct Memory {
    std::unique_ptr<unsigned char[]> arm{new unsigned char[FLEXCOMP_MEMORY_BYTES]};
    std::unique_ptr<unsigned char[]> can{new unsigned char[FLEXCOMP_CAN_BYTES]};
    std::unique_ptr<unsigned char[]> rtu{new unsigned char[FLEXCOMP_RTU_BYTES]};
    std::array<std::unique_ptr<unsigned char[]>, 3> tcp{
        std::unique_ptr<unsigned char[]>(new unsigned char[FLEXCOMP_TCP_BYTES]),
        std::unique_ptr<unsigned char[]>(new unsigned char[FLEXCOMP_TCP_BYTES]),
        std::unique_ptr<unsigned char[]>(new unsigned char[FLEXCOMP_TCP_BYTES])};
  };

  static std::uint32_t word(const Bytes& record, std::size_t at) {
    return static_cast<std::uint32_t>(record[at]) << 24U | static_cast<std::uint32_t>(record[at + 1]) << 16U |
           static_cast<std::uint32_t>(record[at + 2]) << 8U | record[at + 3];
  }

  /// Flash with so many sets, as a controller left it that trusts keys or does not.
  static const Slots& flash_with(unsigned sets, bool is_signed) {
    static const auto make = [](unsigned start) {
      std::array<Slots, 4> made;
      for (Slots& slots : made) {
        for (auto& slot : slots) slot.fill(0xFF);
      }
      const auto after = [start](const Slots& before, unsigned number, std::uint32_t sequence) {
        Device device(before, start);
        device.ordinary_steps(1);  // it takes up what was loaded; before that the store is busy
        const unsigned answer = device.push(device.image(number, sequence));
        const flexcomp_state s = device.state();
        if (answer != 0) {
          finding(std::string("a good set was not taken: ") + flexcomp_answer_text(answer) + ", " +
                  flexcomp_refusal_text(s.refusal) + ", " + std::to_string(s.detail));
        }
        return device.flash_;
      };
      made[1] = after(made[0], 2, 7);
      made[2] = after(made[1], 5, 8);
      return made;
    };
    static const std::array<Slots, 4> all = make(16);
    if (!is_signed) return all[sets];
    static const std::array<Slots, 4> all_signed = make(16 + 32);
    return all_signed[sets];
  }
  Device(const Slots& flash, unsigned start) : start_(start), flash_(flash) { power_on(); }

  template <std::size_t N>
  static void require_finite(const std::array<flexcomp_real, N>& values, const char* of) {
    for (const flexcomp_real v : values) {
      if (!std::isfinite(v)) finding(std::string("a number that is not finite left ") + of);
    }
  }

  void check_step(flexcomp_status status, const Joints& out) {
    if (status != FLEXCOMP_REFUSED) is_placed_ = true;
    for (const flexcomp_real v : out) {
      require(std::isfinite(v), "a number that is not finite left a step");
      require(!is_placed_ || std::abs(v) <= static_cast<flexcomp_real>(most_rad),
              "a joint beyond its limit left a step");
    }
    const std::uint32_t flags = flexcomp_step_flags(arm_);
    require(flags < 256, "a flag without a meaning");
    require(static_cast<unsigned>(status) ==
                static_cast<unsigned>(flexcomp::summary(static_cast<std::uint16_t>(flags))),
            "the status is not the summary of the flags");
    flexcomp_diagnostics d;
    d.struct_size = sizeof d;
    require(flexcomp_get_diagnostics(arm_, &d) == 1, "no diagnostics");
    require(d.status == status && d.flags == flags, "diagnostics of another step");
    require(std::isfinite(d.remaining_position_m) && std::isfinite(d.remaining_orientation_rad),
            "a remaining error that is not finite");
    for (std::size_t j = 0; j < 6; ++j) {
      require(std::isfinite(d.correction_rad[j]) && std::isfinite(d.offset_rad[j]),
              "a correction that is not finite");
      require(d.direction[j] >= -1 && d.direction[j] <= 1, "a direction beyond 1");
    }
  }

  /// Registers by the connection that watches.
  Bytes registers(unsigned address, unsigned count) {
    const Bytes pdu =
        ask(connections, Output().u8(3).u8(address >> 8U).u8(address & 0xFFU).u8(0).u8(count).out);
    require(pdu.size() == 2 + 2U * count && pdu[0] == 3 && pdu[1] == 2 * count, "registers cannot be read");
    return {pdu.begin() + 2, pdu.end()};
  }

  static flexcomp_storage_result read_slot(void* self, unsigned slot, std::uint32_t offset, std::uint8_t* to,
                                           std::uint32_t size) {
    Device& d = *static_cast<Device*>(self);
    require(slot < 2 && offset <= FLEXCOMP_SLOT_BYTES && size <= FLEXCOMP_SLOT_BYTES - offset,
            "a read beyond a slot");
    if (d.is_dead_ || d.fails()) return FLEXCOMP_STORAGE_FAILED;
    std::copy_n(d.flash_[slot].begin() + offset, size, to);
    return FLEXCOMP_STORAGE_DONE;
  }
  static flexcomp_storage_result erase_slot(void* self, unsigned slot) {
    Device& d = *static_cast<Device*>(self);
    require(slot < 2, "an erase beyond the slots");
    if (d.is_dead_ || d.fails()) return FLEXCOMP_STORAGE_FAILED;
    if (d.is_busy()) return FLEXCOMP_STORAGE_BUSY;
    if (!d.power_fails_within(FLEXCOMP_SLOT_BYTES)) {
      d.flash_[slot].fill(0xFF);
      return FLEXCOMP_STORAGE_DONE;
    }
    for (std::size_t k = 0; k < d.flash_[slot].size(); ++k) {
      // Cut short, any of its bytes may be old or new: here every other one.
      if (d.power_goes()) return FLEXCOMP_STORAGE_FAILED;
      d.flash_[slot][k % 2 == 0 ? k / 2 : FLEXCOMP_SLOT_BYTES - 1 - k / 2] = 0xFF;
    }
    return FLEXCOMP_STORAGE_DONE;
  }
  static flexcomp_storage_result write_slot(void* self, unsigned slot, std::uint32_t offset,
                                            const std::uint8_t* from, std::uint32_t size) {
    Device& d = *static_cast<Device*>(self);
    require(slot < 2 && size != 0 && size <= 256 && size % 32 == 0 && offset % 32 == 0 &&
                offset <= FLEXCOMP_SLOT_BYTES && size <= FLEXCOMP_SLOT_BYTES - offset,
            "a write that flexcomp.h does not allow");
    if (d.is_dead_ || d.fails()) return FLEXCOMP_STORAGE_FAILED;
    if (d.is_busy()) return FLEXCOMP_STORAGE_BUSY;
    for (std::uint32_t k = 0; k < size; ++k) {
      if (d.power_goes()) return FLEXCOMP_STORAGE_FAILED;
      std::uint8_t& byte = d.flash_[slot][offset + k];
      byte = static_cast<std::uint8_t>(byte & from[k]);
    }
    return FLEXCOMP_STORAGE_DONE;
  }
  bool fails() {
    if (fail_next_ == 0) return false;
    if (fail_after_ != 0) {
      --fail_after_;
      return false;
    }
    --fail_next_;
    told_counter_ = 0;  // what cannot be written is lost with the power
    return true;
  }
  bool is_busy() {
    if (busy_next_ == 0) return false;
    --busy_next_;
    return true;
  }
  /// False where so many bytes can be programmed or erased; they are counted then.
  bool power_fails_within(std::uint32_t bytes) {
    if (power_left_ < 0) return false;
    if (power_left_ < static_cast<std::int64_t>(bytes)) return true;
    power_left_ -= static_cast<std::int64_t>(bytes);
    return false;
  }
  bool power_goes() {
    if (power_left_ < 0) return false;
    if (power_left_ == 0) is_dead_ = true;
    --power_left_;
    return is_dead_;
  }

  static unsigned permit(void* self, unsigned command, unsigned is_local) {
    require(command <= 0xFFFF && is_local <= 1, "permit was asked for what is no command");
    const unsigned allowed = static_cast<Device*>(self)->allowed_;
    if (command < 32 && (allowed >> command & 1U) == 0) return FLEXCOMP_REFUSE;
    // Without an unlock, which an input hardly ever guesses; half of the bits ask for it.
    return command < 16 && (allowed >> (command + 16U) & 1U) != 0 ? FLEXCOMP_AUTHORISE : FLEXCOMP_ALLOW;
  }
  static void log(void*, unsigned event, std::uint32_t) { require(event >= 1, "an event without a number"); }

  static int check_signature(void* self, const std::uint8_t* key, const std::uint8_t* signature,
                             const std::uint8_t* message, std::size_t size) {
    Device& d = *static_cast<Device*>(self);
    require(size == flexcomp::signing::message_bytes, "a message of another length");
    require(key[0] >= 1 && key[0] <= d.trusted() && key[31] == key[0], "a key that is not trusted");
    require(flexcomp::is_canonical_signature(signature), "a second form of a signature was asked about");
    if (d.slow_checks_ != 0) {
      --d.slow_checks_;
      return 2;
    }
    const auto good = signature_of_message(key, message);
    // Any other number than 1 and 2 is a no.
    if (!std::equal(good.begin(), good.end(), signature)) return signature[0] == 0 ? -1 : signature[0] + 2;
    ++d.checks_;
    return 1;
  }
  static int load_can(void* self, std::uint8_t* bytes) {
    const Device& d = *static_cast<Device*>(self);
    std::copy(d.can_record_.begin(), d.can_record_.end(), bytes);
    return d.has_can_record_ ? 1 : 0;
  }
  static int save_can(void* self, const std::uint8_t* bytes) {
    Device& d = *static_cast<Device*>(self);
    if (d.fails()) return 0;
    std::copy_n(bytes, d.can_record_.size(), d.can_record_.begin());
    d.has_can_record_ = true;
    return 1;
  }

  static int send_frame(void* self, std::uint16_t id, const std::uint8_t* bytes, std::uint8_t size) {
    Device& d = *static_cast<Device*>(self);
    require(id < 0x800 && size <= 8, "no frame of CAN");
    if (id == 0x580U + node_id) {
      require(size == 8, "an SDO answer of other than 8 bytes");
    } else if (id == 0x700U + node_id) {
      require(size == 1 && (bytes[0] == 0 || bytes[0] == 4 || bytes[0] == 5 || bytes[0] == 127),
              "a heartbeat without a state");
    }
    if (d.refused_frames_ != 0) {
      --d.refused_frames_;
      return 0;
    }
    if (id == (d.is_second_ ? channel_answer : 0x580U + node_id)) d.answer_.assign(bytes, bytes + size);
    return 1;
  }
  static void send_rtu(void*, const std::uint8_t* bytes, std::size_t size) {
    require(size >= 4 && size <= 256, "an RTU answer of a length that there is not");
    require(bytes[0] == unit_id, "an RTU answer of another unit");
    require(modbus_crc_of(Bytes(bytes, bytes + size)) == 0, "an RTU answer with a wrong CRC");
    if ((bytes[1] & 0x80U) != 0)
      require(size == 5 && bytes[2] >= 1 && bytes[2] <= 6, "no exception of Modbus");
  }
  static void send_tcp(void* self, const std::uint8_t* bytes, std::size_t size) {
    Device& d = *static_cast<Device*>(self);
    require(size >= 9 && size <= 260, "a TCP answer of a length that there is not");
    require(bytes[2] == 0 && bytes[3] == 0, "a TCP answer of another protocol");
    require((static_cast<std::size_t>(bytes[4]) << 8U | bytes[5]) == size - 6,
            "a TCP answer with a wrong length");
    d.answer_.assign(bytes, bytes + size);
    ++d.answers_;
  }

  const unsigned start_;
  Slots flash_;
  Memory memory_;
  flexcomp_arm* arm_ = nullptr;
  flexcomp_can* can_ = nullptr;
  flexcomp_rtu* rtu_ = nullptr;
  std::array<flexcomp_tcp*, connections + 1> tcp_{};
  bool is_dead_ = false;
  bool is_placed_ =
      false;  ///< by a command that was used or by start: before that a refused command goes out as it is
  std::int64_t power_left_ = -1;
  unsigned fail_next_ = 0;
  unsigned fail_after_ = 0;
  unsigned busy_next_ = 0;
  unsigned refused_frames_ = 0;
  unsigned allowed_ = 0xFFFFFFFF;
  std::uint32_t now_ms_ = 0xFFFFF000;  // clocks wrap
  std::uint32_t now_us_ = 0xFFFFF000;
  std::uint32_t at_ = 0;
  unsigned transaction_ = 0;
  std::uint32_t seen_crc_ = 0;
  std::uint64_t counter_ = 0;       ///< the last one that was read, since the start
  std::uint64_t told_counter_ = 0;  ///< the highest that a start has told
  /// Signatures that were right, and starts: each takes a place of a memory that has few (docs/security.md, "Left to the
  /// integrator").
  unsigned checks_ = 0;
  unsigned slow_checks_ = 0;
  std::array<std::uint8_t, flexcomp::wire::canopen::communication_bytes> can_record_{};
  bool has_can_record_ = false;
  bool is_second_ = false;
  Bytes last_request_;
  Bytes answer_;
  unsigned answers_ = 0;
};

/// Joints and context of odd numbers. Reads one byte where all is ordinary.
struct OddStep {
  Device::Joints q{};
  Device::Joints rate{};
  flexcomp_context context{};
  bool with_context = false;

  OddStep(Input& input, const flexcomp_arm* arm) {
    const unsigned what = input.u8();
    const auto number = [&input](bool is_odd, double otherwise) {
      return static_cast<flexcomp_real>(is_odd ? input.odd_number() : otherwise);
    };
    for (std::size_t j = 0; j < 6; ++j)
      q[j] = number((what >> j & 1U) != 0, 0.1 * static_cast<double>(j) + 0.1);
    if ((what & 64U) != 0) {
      for (flexcomp_real& r : rate) r = number(true, 0);
    }
    with_context = (what & 128U) != 0;
    if (!with_context) return;
    flexcomp_context_default(arm, &context);
    const unsigned which = input.u8();
    context.payload_kg = number((which & 1U) != 0, 1.1);
    for (flexcomp_real& v : context.payload_com_m) v = number((which & 2U) != 0, 0.05);
    for (flexcomp_real& v : context.force_n) v = number((which & 4U) != 0, 0);
    context.temperature_c = number((which & 8U) != 0, 20);
    context.time_s = number((which & 16U) != 0, 0);
    for (flexcomp_real& v : context.relative_speed) v = number((which & 32U) != 0, 0);
  }
  const flexcomp_context* given() const { return with_context ? &context : nullptr; }
};

}  // namespace fuzz
