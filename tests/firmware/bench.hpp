// SPDX-License-Identifier: Apache-2.0
// What the firmware's tests share: an arm, images for it, and a flash memory whose power can be cut at any
// byte.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "flexcomp/image.hpp"
#include "flexcomp_firmware/device.hpp"

namespace flexcomp::firmware::bench {

constexpr double degree = pi / 180;

/// Staubli TX60L with a tool, as in Chen et al. 2019.
inline Robot tx60l() {
  Robot r;
  const double table[6][4] = {{0, 0, 0, -90},   {-90, 0, 400, 0}, {90, 20, 0, 90},
                              {0, 450, 0, -90}, {0, 0, 0, 90},    {0, 70, 0, 0}};
  for (std::size_t i = 0; i < 6; ++i) {
    r.links[i] = {table[i][0] * degree, table[i][1] * 1e-3, table[i][2] * 1e-3, table[i][3] * degree, 0};
    r.limits[i] = {-2.2, 2.2};
  }
  r.tool_xyz_m = {0.010, 0.030, 0.060};
  r.payload_kg = 1.108;
  r.payload_com_m = {0.005, 0.008, 0.060};
  r.name_hash = name_hash("bench", 5);
  return r;
}

using Bytes = std::vector<std::uint8_t>;

/// A set like the paper's: geometric errors of `size` times 1e-4, joint compliances, a backlash and a curve.
inline std::vector<Term<Scalar>> some_terms(double size, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<Term<Scalar>> terms;
  const auto add = [&terms](Place place, Basis basis, unsigned joint, double coefficient) -> Term<Scalar>& {
    Term<Scalar> t;
    t.place = place;
    t.basis = basis;
    t.joint = static_cast<std::uint8_t>(joint);
    t.coefficient = static_cast<Scalar>(coefficient);
    return terms.emplace_back(t);
  };
  for (std::uint8_t link = 1; link <= 6; ++link) {
    for (std::uint8_t s = 0; s < 4; ++s) add({link, s}, Basis::one, 0, 1e-4 * size * unit(random));
    add({link, slot::theta}, Basis::load_torque, link - 1U, 2e-5 * size * unit(random));
  }
  add({2, slot::theta}, Basis::direction, 1, 5e-5 * size);
  Term<Scalar>& curve = add({3, slot::theta}, Basis::curve, 2, 1);
  curve.table = 0;
  return terms;
}

/// The image of a list for a robot.
inline Bytes image_of(const Robot& robot, std::uint32_t sequence, const TermList<Scalar>& list) {
  ImageHeader header;
  header.sequence = sequence;
  header.nominal_hash = nominal_hash(robot);
  header.name_hash = robot.name_hash;
  header.unit_hash = robot.unit_hash;
  Bytes out(image_size(list, is_given(robot.unit_hash)));
  encode_image(list, header, out.data(), out.size());
  return out;
}

/// The image of such a set.
inline Bytes make_image(const Robot& robot, std::uint32_t sequence, double size = 1, std::uint32_t seed = 1) {
  const std::vector<Term<Scalar>> terms = some_terms(size, seed);
  std::vector<Scalar> values;
  for (unsigned k = 0; k < 16; ++k) values.push_back(static_cast<Scalar>(1e-4 * size * std::sin(k + seed)));
  Table table;
  table.size = 16;
  return image_of(robot, sequence, {terms.data(), terms.size(), &table, 1, values.data(), values.size()});
}

/// Writes the CRC anew after bytes were changed.
inline void reseal(Bytes& image) {
  store_u32(image.data() + image.size() - 4, crc32(image.data(), image.size() - 4));
}

struct PowerCut {};

/// NOR flash: programming only clears bits, erasing sets them. `power` bytes may still be programmed or
/// erased; then the power goes (an exception stands for it) and everything but the memory is lost.
class Flash {
 public:
  std::array<std::array<std::uint8_t, slot_bytes>, 2> slots{};
  long power = -1;  ///< -1: no end
  bool fails = false;
  bool double_writes = false;  ///< a byte was programmed twice between two erases
  unsigned erased_slots = 0;
  std::mt19937 random{7};

  Flash() {
    for (auto& s : slots) s.fill(0xFF);
  }

  Storage hooks() {
    Storage s;
    s.user = this;
    s.read = [](void* self, unsigned slot, std::uint32_t offset, std::uint8_t* to, std::uint32_t size) {
      auto& flash = *static_cast<Flash*>(self);
      if (slot > 1 || offset > slot_bytes || size > slot_bytes - offset) return StorageResult::failed;
      std::memcpy(to, flash.slots[slot].data() + offset, size);
      return StorageResult::done;
    };
    s.erase = [](void* self, unsigned slot) {
      auto& flash = *static_cast<Flash*>(self);
      if (flash.fails || slot > 1) return StorageResult::failed;
      ++flash.erased_slots;
      // A sector is erased as a whole; cut short, any of its bytes may be old or new.
      if (flash.power >= 0 && flash.power < static_cast<long>(slot_bytes)) {
        for (auto& b : flash.slots[slot]) {
          if (static_cast<long>(flash.random() % slot_bytes) < flash.power) b = 0xFF;
        }
        throw PowerCut{};
      }
      if (flash.power >= 0) flash.power -= static_cast<long>(slot_bytes);
      flash.slots[slot].fill(0xFF);
      return StorageResult::done;
    };
    s.write = [](void* self, unsigned slot, std::uint32_t offset, const std::uint8_t* from,
                 std::uint32_t size) {
      auto& flash = *static_cast<Flash*>(self);
      if (flash.fails || slot > 1 || size == 0 || size > 256 || size % 32 != 0 || offset % 32 != 0 ||
          offset > slot_bytes || size > slot_bytes - offset) {
        return StorageResult::failed;
      }
      for (std::uint32_t k = 0; k < size; ++k) {
        if (flash.power == 0) throw PowerCut{};
        if (flash.power > 0) --flash.power;
        std::uint8_t& b = flash.slots[slot][offset + k];
        if (b != 0xFF) flash.double_writes = true;
        b = static_cast<std::uint8_t>(b & from[k]);
      }
      return StorageResult::done;
    };
    return s;
  }
};

inline Scalar real(double v) { return static_cast<Scalar>(v); }

/// An ordinary pose, rad.
inline Joints some_joints() { return {real(0.1), real(0.2), real(0.3), real(0.4), real(0.5), real(0.6)}; }

/// A cycle of a second: neither a rate nor an offset holds a correction back for more than a cycle.
inline DeviceSettings following_at_once() {
  DeviceSettings settings;
  settings.control.motion.cycle_us = 1000000;
  return settings;
}

inline double distance(const Joints& a, const Joints& b) {
  double greatest = 0;
  for (std::size_t j = 0; j < joints; ++j)
    greatest = std::max(greatest, std::abs(static_cast<double>(a[j] - b[j])));
  return greatest;
}

/// A command as a client gives it: what destroys sets after an unlock, which is no command of its own here.
inline wire::Answer run_unlocked(Store& store, wire::Command command, std::uint32_t argument = 0,
                                 Origin origin = 1) {
  if (command == wire::Command::rollback || command == wire::Command::restore_defaults) {
    wire::Status status;
    store.run(wire::Command::unlock, 0, origin);
    store.status(status);
    store.run(wire::Command::unlock, status.detail, origin);
  }
  return store.run(command, argument, origin);
}

/// An arm on a flash, with the control cycle at hand.
class Arm {
  std::unique_ptr<Flash> own_;

 public:
  explicit Arm(Flash& memory, DeviceSettings settings = {}, Robot r = tx60l(), const Trust& trust = {})
      : flash(memory), robot(r), device(std::make_unique<Device>(r, memory.hooks(), settings)) {
    device->set_trust(trust);
    device->store().boot();
    device->store().poll(now_ms);
    step();
  }
  /// On a flash of its own.
  explicit Arm(DeviceSettings settings = {}, Robot r = tx60l())
      : Arm(std::make_unique<Flash>(), settings, r) {}

  StepResult step(const Joints& q = {}) { return device->step(q, default_context<Scalar>(robot)); }

  /// Background and cycle, until the work has ended.
  wire::Status settle() {
    until_done();
    for (int k = 0; k < 20; ++k) {
      device->store().poll(now_ms += 1);
      step();
    }
    return device->status();
  }

  /// Background and cycle, until the store is no longer working.
  wire::Status until_done() {
    for (int k = 0; k < 5000; ++k) {
      if (device->status().state != static_cast<std::uint16_t>(wire::StoreState::working)) break;
      device->store().poll(now_ms += 1);
      step();
    }
    return device->status();
  }

  /// verify, and what became of it.
  wire::Answer verify(Origin origin = 1) {
    const wire::Answer a = run(wire::Command::verify, 0, origin);
    return a == wire::Answer::accepted ? static_cast<wire::Answer>(until_done().answer) : a;
  }

  wire::Answer run(wire::Command c, std::uint32_t argument = 0, Origin origin = 1) {
    return run_unlocked(device->store(), c, argument, origin);
  }

  wire::Answer stage(const Bytes& image, Origin origin = 1) {
    const wire::Answer a = run(wire::Command::begin, static_cast<std::uint32_t>(image.size()), origin);
    if (a != wire::Answer::accepted) return a;
    return device->store().write(0, image.data(), static_cast<std::uint32_t>(image.size()), origin);
  }

  /// What became of a set: the refusal, or none.
  Refusal offer(const Bytes& image) {
    if (stage(image) == wire::Answer::accepted) verify();
    const wire::Status s = device->status();
    return static_cast<Refusal>(s.refusal);
  }

  wire::Answer push(const Bytes& image, wire::Command how = wire::Command::commit,
                    std::uint32_t argument = 0) {
    wire::Answer a = stage(image);
    if (a == wire::Answer::accepted) a = run(how, argument);
    if (a != wire::Answer::accepted) return a;
    return static_cast<wire::Answer>(settle().answer);
  }

  Bytes pull() {
    Bytes out(device->store().active_bytes());
    if (!device->store().read_active(0, out.data(), static_cast<std::uint32_t>(out.size()))) out.clear();
    return out;
  }

  std::uint32_t sequence() const { return device->store().active_sequence(); }

  Flash& flash;
  Robot robot;
  std::unique_ptr<Device> device;
  std::uint32_t now_ms = 0;

 private:
  Arm(std::unique_ptr<Flash> own, DeviceSettings settings, Robot r) : Arm(*own, settings, r) {
    own_ = std::move(own);
  }
};

/// What the core makes of a command with the set of this image.
inline Compensated<Scalar, joints> by_the_core(const Robot& robot, const Bytes& image, const Joints& q,
                                               const FirmwareContext& context) {
  auto model = std::make_unique<FirmwareModel>();
  if (model_from_image(image.data(), image.size(), robot, *model) != Refusal::none) return {};
  return compensate(*model, q, context, CompensationSettings<Scalar>{});
}

}  // namespace flexcomp::firmware::bench
