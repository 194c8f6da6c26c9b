// SPDX-License-Identifier: Apache-2.0
// The most that one flexcomp_poll takes while a set is checked: at most 20,000 instructions (in float 46,000), with the paper's set and with
// the largest ones: all table values in one grid, 64 terms that read it, 64 link-weight levers, 64 curves of 256 values; and
// signed, the integrator's Ed25519 left out.
#include <new>

#include "budget_arm.hpp"
#include "flexcomp/signature.hpp"
#include "flexcomp_firmware/device.hpp"
#include "instructions.hpp"
#include "print.hpp"

namespace {

using budget::Scalar;
using flexcomp::Basis;
using flexcomp::boards::instructions;
using flexcomp::boards::ticks;
namespace slot = flexcomp::slot;

// In float a table's values are converted from binary64 in software: the longest slice is then that of one record.
constexpr std::uint32_t most_allowed = sizeof(Scalar) == 8 ? 20000 : 46000;

using flexcomp::firmware::Device;
alignas(Device) unsigned char memory[sizeof(Device)];
std::uint8_t image[FLEXCOMP_STAGING_BYTES];
std::array<flexcomp::Term<Scalar>, FLEXCOMP_TERMS> terms;
std::array<Scalar, FLEXCOMP_TABLE_VALUES> values;
flexcomp::Table table;
std::uint32_t own;  // ticks of two readings with nothing between
bool is_signed = false;

std::size_t encode(std::size_t count, std::size_t tables) {
  const flexcomp::TermList<Scalar> list{terms.data(), count,         &table,
                                        tables,       values.data(), tables == 0 ? 0U : table.size};
  const flexcomp::NominalRobot<6> robot = selftest::tx60l();
  flexcomp::ImageHeader header;
  header.sequence = 1;
  header.nominal_hash = flexcomp::nominal_hash(robot);
  header.name_hash = robot.name_hash;
  if (is_signed) header.unit_hash = robot.name_hash;
  return flexcomp::encode_image(list, header, image, sizeof image);
}

/// Fills all terms with one kind.
std::size_t many(Basis basis, bool off_the_joints) {
  for (std::size_t k = 0; k < terms.size(); ++k) {
    flexcomp::Term<Scalar>& t = terms[k];
    t = {};
    t.place = {static_cast<std::uint8_t>(1 + k % 6), off_the_joints ? slot::alpha : slot::theta};
    t.basis = basis;
    t.coefficient = Scalar(1e-5F);
    t.argument = Scalar(3);
    t.table = basis == Basis::grid || basis == Basis::curve ? std::uint16_t{0} : flexcomp::no_table;
    if (basis == Basis::link_weight) {
      // In the order that takes the most sorting.
      t.joint = static_cast<std::uint8_t>(4 - k * 5 / terms.size());
      t.distal_joint = 5;
    } else {
      t.joint = static_cast<std::uint8_t>((k + 1) % 6);
    }
  }
  return terms.size();
}

void grid_of_all_values() {
  table = {};
  table.rows = 64;
  table.columns = 10;
  table.size = 64 + 10 + 640;
  for (std::size_t k = 0; k < 64; ++k) values[k] = Scalar(0.1F) * static_cast<Scalar>(k);
  for (std::size_t k = 0; k < 10; ++k) values[64 + k] = Scalar(0.1F) * static_cast<Scalar>(k);
  for (std::size_t k = 0; k < 640; ++k) values[74 + k] = Scalar(1e-3F) * static_cast<Scalar>(k % 7);
}

/// Signs the image: with zeros, which the function below accepts.
std::size_t with_signature(std::size_t size) {
  if (size == 0 || flexcomp::signed_size(size) > sizeof image) return 0;
  const std::uint8_t key[flexcomp::signing::key_bytes] = {};
  const std::uint8_t signature[flexcomp::signing::signature_bytes] = {};
  flexcomp::append_signature(image, size, 1, flexcomp::key_id(key));
  flexcomp::put_signature(image, flexcomp::signed_size(size), signature);
  return flexcomp::signed_size(size);
}

bool too_much = false;

/// The most that one poll takes from verify until the store is no longer working; false where the transfer fails.
bool check(const char* what, std::size_t size) {
  if (size == 0) return false;
  flexcomp::firmware::DeviceSettings settings;
  flexcomp::NominalRobot<6> robot = selftest::tx60l();
  if (is_signed) robot.unit_hash = robot.name_hash;
  auto* device = new (memory) Device(robot, {}, settings);
  static const std::uint8_t keys[1][flexcomp::signing::key_bytes] = {};
  if (is_signed) {
    device->set_trust({nullptr, keys, 1,
                       [](void*, const std::uint8_t*, const std::uint8_t*, const std::uint8_t*,
                          std::uint32_t) { return 1; }});
  }
  flexcomp::firmware::Store& store = device->store();
  using flexcomp::wire::Answer;
  using flexcomp::wire::Command;
  if (store.run(Command::begin, static_cast<std::uint32_t>(size), 1) != Answer::accepted) return false;
  store.write(0, image, static_cast<std::uint32_t>(size), 1);
  if (store.run(Command::verify, 0, 1) != Answer::accepted) return false;
  std::uint32_t most = 0, polls = 0, at = 0;
  flexcomp::wire::Status status;
  for (;; ++polls) {
    store.status(status);
    if (status.state != static_cast<std::uint16_t>(flexcomp::wire::StoreState::working)) break;
    if (polls == 5000) return false;
    const std::uint32_t from = ticks();
    store.poll(0);
    const std::uint32_t count = instructions(from + own, ticks());
    if (count > most) {
      most = count;
      at = polls;
    }
  }
  print(what, ": ", most, " instructions in poll ", at, " of ", polls, ", refusal ",
        static_cast<std::uint32_t>(status.refusal), "\n");
  too_much = too_much || most > most_allowed;
  device->~Device();
  return true;
}

}  // namespace

int main() {
  flexcomp::boards::start_instruction_counter();
  const std::uint32_t from = ticks();
  own = ticks() - from;
  if (!check("the paper's 39 terms and 6 curves",
             budget::make_image(budget::Set::curves, image, sizeof image)))
    return 2;
  grid_of_all_values();
  if (!check("a grid of all values", encode(many(Basis::grid, false) / 8, 1))) return 3;
  if (!check("64 terms of a grid", encode(many(Basis::grid, false), 1))) return 4;
  if (!check("32 terms of a grid off the joints", encode(many(Basis::grid, true) / 2, 1))) return 5;
  if (!check("64 levers", encode(many(Basis::link_weight, false), 0))) return 6;
  if (!check("64 levers off the joints", encode(many(Basis::link_weight, true), 0))) return 7;
  if (!check("64 waves off the joints", encode(many(Basis::sine, true), 0))) return 8;
  table = {};
  table.size = 256;
  for (std::size_t k = 0; k < 256; ++k) values[k] = Scalar(1e-3F) * static_cast<Scalar>(k % 3);
  if (!check("64 terms of a curve", encode(many(Basis::curve, false), 1))) return 9;
  is_signed = true;
  if (!check("64 terms of a curve, signed", with_signature(encode(many(Basis::curve, false), 1)))) return 10;
  return too_much ? 1 : 0;
}
