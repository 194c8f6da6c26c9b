// SPDX-License-Identifier: Apache-2.0
#pragma once
// An arm with a set in its storage, as the budget programs measure it: the TX60L with the paper's 39 terms and, where
// asked for, a curve on each of the six joints.
#include <cstring>

#include "flexcomp.h"
#include "flexcomp/forward.hpp"
#include "flexcomp/image.hpp"
#include "selftest.hpp"

namespace budget {

using Scalar = FLEXCOMP_SCALAR;

constexpr std::size_t paper_terms = 39;  // entries[39] is the curve
constexpr std::size_t curve_values = 32;

struct Storage {
  alignas(8) std::uint8_t bytes[FLEXCOMP_SLOT_BYTES];
};

inline flexcomp_storage_result read(void* user, unsigned slot, std::uint32_t offset, std::uint8_t* to,
                                    std::uint32_t size) {
  std::memset(to, 0xFF, size);
  if (slot == 0) std::memcpy(to, static_cast<Storage*>(user)->bytes + offset, size);
  return FLEXCOMP_STORAGE_DONE;
}
inline flexcomp_storage_result erase(void*, unsigned) { return FLEXCOMP_STORAGE_FAILED; }
inline flexcomp_storage_result write(void*, unsigned, std::uint32_t, const std::uint8_t*, std::uint32_t) {
  return FLEXCOMP_STORAGE_FAILED;
}

/// Effects of eleven kinds beside the geometry: with the paper's compliance and link weight nine more, 27 terms of which
/// eleven move links or the base.
inline std::size_t add_eleven_kinds(flexcomp::Term<Scalar>* to) {
  using flexcomp::Basis;
  namespace slot = flexcomp::slot;
  std::size_t count = 0;
  const auto add = [&](std::uint8_t body, std::uint8_t slot, Basis basis, float coefficient,
                       std::uint8_t joint, float argument = 0) {
    flexcomp::Term<Scalar>& t = to[count++];
    t = {};
    t.place = {body, slot};
    t.basis = basis;
    t.joint = joint;
    t.argument = Scalar(argument);
    t.coefficient = Scalar(coefficient);
  };
  for (const std::uint8_t j : {std::uint8_t{1}, std::uint8_t{2}}) {
    const auto link = static_cast<std::uint8_t>(j + 1);
    add(link, slot::theta, Basis::load_torque_cubed, 1e-8F, j);
    add(link, slot::theta, Basis::sine, 1e-4F, j, 1);
    add(link, slot::theta, Basis::cosine, 1e-4F, j, 1);
    add(link, slot::theta, Basis::direction, 5e-5F, j);
    add(link, slot::theta, Basis::joint_position, 1e-4F, j);
  }
  for (const std::uint8_t j : {std::uint8_t{0}, std::uint8_t{3}, std::uint8_t{5}})
    add(static_cast<std::uint8_t>(j + 1), slot::theta, Basis::sine, 1e-4F, j, 2);
  for (const std::uint8_t j : {std::uint8_t{3}, std::uint8_t{4}})
    add(6, slot::theta, Basis::joint_position, 1e-4F, j);  // coupling
  for (const std::uint8_t j : {std::uint8_t{1}, std::uint8_t{4}}) {
    const auto link = static_cast<std::uint8_t>(j + 1);
    add(link, slot::alpha, Basis::sine, 1e-4F, j, 1);
    add(link, slot::gamma, Basis::cosine, 1e-4F, j, 1);
  }
  add(2, slot::alpha, Basis::load_moment_x, 2e-6F, 1);
  add(3, slot::beta, Basis::load_moment_y, 2e-6F, 2);
  add(2, slot::a, Basis::thermal, 12e-6F, 1);
  add(3, slot::d, Basis::thermal, 12e-6F, 2);
  add(4, slot::d, Basis::thermal, 12e-6F, 3);
  add(0, slot::rx, Basis::base_moment_x, 1e-6F, 0, -0.3F);
  add(0, slot::ry, Basis::base_moment_y, 1e-6F, 0, -0.3F);
  return count;
}

/// The sets that are measured: the paper's terms alone, with a curve on every joint, with effects of eleven kinds.
enum class Set { paper, curves, eleven_kinds };

inline std::size_t make_image(Set set, std::uint8_t* out, std::size_t size) {
  static std::array<flexcomp::Term<Scalar>, paper_terms + 28> terms;
  static std::array<flexcomp::Table, 6> tables;
  static std::array<Scalar, 6 * curve_values> values;
  for (std::size_t k = 0; k < paper_terms; ++k) terms[k] = selftest::make_term<Scalar>(selftest::entries[k]);
  std::uint32_t state = 2019;
  for (Scalar& v : values) {
    state = state * 1664525U + 1013904223U;
    v = static_cast<Scalar>(static_cast<std::int32_t>(state >> 8U) - (1 << 23)) * Scalar(3e-4F / (1 << 23));
  }
  const std::size_t curves = set == Set::curves ? 6 : set == Set::eleven_kinds ? 1 : 0;
  for (std::size_t j = 0; j < curves; ++j) {
    flexcomp::Term<Scalar>& t = terms[paper_terms + j];
    t = {};
    t.place = {static_cast<std::uint8_t>(j + 1), flexcomp::slot::theta};
    t.basis = flexcomp::Basis::curve;
    t.joint = static_cast<std::uint8_t>(j);
    t.effect = flexcomp::Effect::joint_curve;
    t.table = static_cast<std::uint16_t>(j);
    tables[j].offset = static_cast<std::uint16_t>(j * curve_values);
    tables[j].size = curve_values;
  }
  std::size_t count = paper_terms + curves;
  if (set == Set::eleven_kinds) count += add_eleven_kinds(terms.data() + count);
  const flexcomp::TermList<Scalar> list{terms.data(), count,         tables.data(),
                                        curves,       values.data(), curves * curve_values};
  const flexcomp::NominalRobot<6> robot = selftest::tx60l();
  flexcomp::ImageHeader header;
  header.sequence = 1;
  header.nominal_hash = flexcomp::nominal_hash(robot);
  header.name_hash = robot.name_hash;
  return flexcomp::encode_image(list, header, out, size);
}

/// Writes the seal of the image that is there (firmware/include/flexcomp_firmware/store.hpp).
inline void seal(Storage& storage, std::size_t size) {
  std::uint8_t* at = storage.bytes + FLEXCOMP_SLOT_BYTES - 32;
  std::memset(at, 0, 32);
  std::memcpy(at, "FLXS", 4);
  flexcomp::store_u32(at + 4, static_cast<std::uint32_t>(size));
  flexcomp::store_u32(at + 8, 1);
  flexcomp::store_u32(at + 12, flexcomp::load_u32(storage.bytes + size - 4));
  flexcomp::store_u32(at + 28, flexcomp::crc32(at, 28));
}

/// Writes the image and its seal. False where it does not fit.
inline bool store_image(Set set, Storage& storage) {
  const std::size_t size = make_image(set, storage.bytes, FLEXCOMP_STAGING_BYTES);
  if (size == 0) return false;
  seal(storage, size);
  return true;
}

/// The nominal TX60L for the C interface.
inline flexcomp_robot c_robot() {
  const flexcomp::NominalRobot<6> r = selftest::tx60l();
  flexcomp_robot c;
  flexcomp_robot_default(&c);
  c.name = selftest::robot_name;
  for (std::size_t i = 0; i < 6; ++i) {
    c.links[i] = {r.links[i].theta_rad, r.links[i].d_m, r.links[i].a_m, r.links[i].alpha_rad,
                  r.links[i].beta_rad};
    c.min_rad[i] = r.limits[i].min_rad;
    c.max_rad[i] = r.limits[i].max_rad;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    c.tool_xyz_m[k] = r.tool_xyz_m[k];
    c.payload_com_m[k] = r.payload_com_m[k];
  }
  c.payload_kg = r.payload_kg;
  return c;
}

/// Starts an arm with this set; null where its set did not become active.
inline flexcomp_arm* start(flexcomp_memory& memory, Storage& storage, Set set,
                           const flexcomp_settings* settings) {
  const flexcomp_robot robot = c_robot();
  const flexcomp_storage hooks = {&storage, read, erase, write};
  if (!store_image(set, storage)) return nullptr;
  flexcomp_arm* arm = flexcomp_init(&memory, sizeof memory, &robot, settings, &hooks);
  if (arm == nullptr || flexcomp_boot(arm) != 0) return nullptr;
  return arm;
}

/// Joint commands that fill the joint ranges evenly and at random, but not beyond the limits.
class Commands {
 public:
  explicit Commands(std::uint32_t seed) : state_(seed) {}
  void next(Scalar q[6]) {
    const flexcomp::NominalRobot<6> robot = selftest::tx60l();
    for (std::size_t i = 0; i < 6; ++i) {
      state_ = state_ * 1664525U + 1013904223U;
      const Scalar u = static_cast<Scalar>(state_ >> 8U) * Scalar(1.0F / (1 << 24));
      const Scalar low = flexcomp::from_binary64<Scalar>(robot.limits[i].min_rad);
      const Scalar high = flexcomp::from_binary64<Scalar>(robot.limits[i].max_rad);
      q[i] = low + (high - low) * u;
    }
  }

 private:
  std::uint32_t state_;
};

/// True where the smallest singular value of the Jacobian (m, rad) at the tool point of the nominal arm is at least
/// 0.1: where J J^T - 0.01 has a Cholesky factor.
template <class Model>
inline bool is_regular(const Model& model, const std::array<Scalar, 6>& q) {
  std::array<flexcomp::SinCos<Scalar>, 6> reading;
  for (std::size_t i = 0; i < 6; ++i) reading[i] = flexcomp::sin_cos(q[i]);
  flexcomp::Frames<Scalar, 6> frames;
  flexcomp::detail::nominal_pass(model, reading, frames);
  const flexcomp::Pose<Scalar> tool =
      flexcomp::Pose<Scalar>{frames.rotation[6], frames.origin[6]} * model.nominal_tool();
  Scalar a[6][6] = {};
  for (std::size_t i = 0; i < 6; ++i) {
    const flexcomp::Vector3<Scalar> z = frames.axis(i, 2);
    const flexcomp::Vector3<Scalar> l = flexcomp::cross<Scalar>(z, tool.position - frames.origin[i]);
    const Scalar column[6] = {l[0], l[1], l[2], z[0], z[1], z[2]};
    for (int r = 0; r < 6; ++r) {
      for (int c = 0; c < 6; ++c) a[r][c] += column[r] * column[c];
    }
  }
  for (int k = 0; k < 6; ++k) a[k][k] -= Scalar(0.01F);
  for (int k = 0; k < 6; ++k) {
    if (!(a[k][k] > Scalar(0))) return false;
    for (int r = k + 1; r < 6; ++r) {
      const Scalar factor = a[r][k] / a[k][k];
      for (int c = k; c < 6; ++c) a[r][c] -= factor * a[k][c];
    }
  }
  return true;
}

}  // namespace budget
