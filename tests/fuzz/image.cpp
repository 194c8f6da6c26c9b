// SPDX-License-Identifier: Apache-2.0
// A parameter image through reader, admission, store and steps. Input: what is mended (bit 0 CRC-32, 1 binding, 2 length, 3 counts,
// 4 signature),
// what the controller is like, the number of odd steps, then the image, then the steps.
#include "whole_device.hpp"

namespace fuzz::image_target {
namespace {

constexpr std::size_t prefix = 5;  // mend, start, size of the image (2), odd steps

void mend(Bytes& image, unsigned what) {
  using namespace flexcomp;
  if (image.size() < image::header_bytes + image::crc_bytes) return;
  if ((what & 2U) != 0) {
    static const Bytes good = good_image(0, 1);
    std::copy_n(good.begin(), 8, image.begin());
    std::copy_n(good.begin() + 16, 64, image.begin() + 16);
  }
  if ((what & 4U) != 0) store_u32(image.data() + 8, static_cast<std::uint32_t>(image.size()));
  if ((what & 8U) != 0) {
    std::size_t at = image::header_bytes;
    unsigned terms = 0;
    unsigned tables = 0;
    std::uint32_t values = 0;
    while (at + image::record_head_bytes + image::crc_bytes <= image.size()) {
      const unsigned type = load_u16(image.data() + at);
      const std::size_t length = load_u16(image.data() + at + 2);
      if (type == image::record_term) ++terms;
      if (type == image::record_table) {
        ++tables;
        values += static_cast<std::uint32_t>(length < 8 ? 0 : (length - 8) / 8);
      }
      at += image::record_head_bytes + length;
    }
    store_u16(image.data() + 80, static_cast<std::uint16_t>(terms));
    store_u16(image.data() + 82, static_cast<std::uint16_t>(tables));
    store_u32(image.data() + 84, values);
  }
  if ((what & 16U) != 0) mend_signature(image, 0);
  if ((what & 1U) != 0) mend_crc(image);
}

void run(Input input) {
  const unsigned what = input.u8();
  const unsigned start = input.u8();
  const std::size_t size = input.u16();
  const unsigned odd_steps = input.u8() % 8;
  Bytes image = input.bytes(size);
  mend(image, what);

  Device device(start & 0x7CU);
  const unsigned answer = device.push(image);
  const flexcomp_state after = device.state();
  if (answer != 0) {
    require(after.active_bytes == 0, "a refused set is active");
    if (answer == 1) require(after.refusal != 0, "refused, and no reason");
    return;
  }
  require(
      after.active_bytes == image.size() && after.active_sequence == flexcomp::load_u32(image.data() + 12),
      "another set is active than was committed");
  device.ordinary_steps(6);
  for (unsigned k = 0; k < odd_steps; ++k) {
    const OddStep odd(input, device.arm());
    if (k % 2 == 0) {
      device.step(odd.q, odd.given());
    } else {
      device.step_rate(odd.q, odd.rate, odd.given());
    }
    device.readings(odd.q, odd.given());
  }
  device.ordinary_steps(2);
  device.check_active();
  device.power_on();
  const flexcomp_state again = device.state();
  require(again.active_sequence == after.active_sequence && again.active_bytes == after.active_bytes &&
              again.faults == 0,
          "a committed set is not there at the next start");
}

Bytes input_of(const Bytes& image, unsigned what, unsigned start) {
  Output out;
  out.u8(what).u8(start).u16(static_cast<unsigned>(image.size())).u8(3).add(image);
  for (unsigned k = 0; k < 24; ++k) out.u8(k == 0 ? 0x80U : 11 * k);
  return out.out;
}

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  for (unsigned k = 0; k < image_count; ++k) all.push_back(input_of(good_image(k, k + 1), 15, 4 * k));
  all.push_back(input_of(good_image(5, 1), 0, 0));
  // Each byte of a set changed.
  for (const unsigned number : {3U, 4U}) {
    const Bytes good = good_image(number, 1);
    for (std::size_t at = 80; at + 4 < good.size(); at += at < 140 ? 1 : 5) {
      Bytes image = good;
      image[at] = static_cast<std::uint8_t>(image[at] ^ 0x50U);
      all.push_back(input_of(image, 5, 0));
    }
  }
  // Bound to a unit, and signed.
  for (unsigned k = 0; k < image_count; k += 2) {
    all.push_back(input_of(good_image(k, k + 1, true), 15, 0x60));
    all.push_back(input_of(signed_image(good_image(k, k + 1, true), 7, 0), 31, 0x20));
    all.push_back(input_of(signed_image(good_image(k, k + 1, true), 7, 2), 15, 0x40));
  }
  // Curves times each factor, grids over any two covariates; small and far too large.
  for (const double size : {1e-5, 1.0, 1e4}) {
    for (unsigned kind = 0; kind < 40; ++kind) {
      FirmwareTerm t;
      t.place = {static_cast<std::uint8_t>(1 + kind % 4), static_cast<std::uint8_t>(kind % 6)};
      t.basis = kind < 4 ? flexcomp::Basis::curve : flexcomp::Basis::grid;
      t.factor = static_cast<flexcomp::Factor>(kind % 4);
      t.joint = static_cast<std::uint8_t>(kind % 4);
      t.coefficient = static_cast<FirmwareScalar>(size);
      t.table = 0;
      std::vector<flexcomp::Table> tables(1);
      tables[0].size = 8;
      if (kind >= 4) {
        t.factor = flexcomp::Factor::one;
        tables[0].rows = tables[0].columns = 2;
        tables[0].row_covariate = static_cast<flexcomp::Covariate>((kind - 4) % 6);
        tables[0].column_covariate = static_cast<flexcomp::Covariate>((kind - 4) / 6);
      }
      all.push_back(input_of(image_of({t}, tables, {-1, 1, -1, 1, 0, 1, 0, 0.5F}, 1), 15, 0));
    }
    // Each other basis at a link, of a size that is refused.
    for (unsigned basis = 0; basis < flexcomp::basis_count; ++basis) {
      if (basis == 15 || basis == 17) continue;
      FirmwareTerm t;
      t.place = {2, static_cast<std::uint8_t>(basis % 5)};
      t.basis = static_cast<flexcomp::Basis>(basis);
      t.joint = 1;
      t.distal_joint = 2;
      t.argument = FirmwareScalar(2);
      t.coefficient = static_cast<FirmwareScalar>(size);
      all.push_back(input_of(image_of({t, t}, {}, {}, 1), 15, 0));
    }
  }
  // One small image for each basis and each place, which admission may take or refuse.
  for (unsigned basis = 0; basis < flexcomp::basis_count; ++basis) {
    std::vector<FirmwareTerm> terms;
    std::vector<flexcomp::Table> tables(1);
    for (unsigned body = 0; body < 4; ++body) {
      FirmwareTerm t;
      t.place = {static_cast<std::uint8_t>(body == 3 ? 0x40 : body), static_cast<std::uint8_t>(basis % 6)};
      t.basis = static_cast<flexcomp::Basis>(basis);
      t.joint = 1;
      t.distal_joint = 2;
      t.argument = FirmwareScalar(2);
      t.coefficient = FirmwareScalar(1e-5F);
      if (t.basis == flexcomp::Basis::curve || t.basis == flexcomp::Basis::grid) t.table = 0;
      terms.push_back(t);
    }
    std::vector<FirmwareScalar> values{-1, 1, -1, 1, 0, 0, 0, 0};
    tables[0].size = 8;
    if (basis == 17) tables[0].rows = tables[0].columns = 2;
    all.push_back(input_of(image_of(terms, tables, values, 1), 15, 0));
  }
  return all;
}

/// Half of the time one record is changed in a way that leaves it a record.
std::size_t mutate(std::uint8_t* data, std::size_t size, std::size_t capacity, unsigned seed) {
  Random random(seed);
  if (size < prefix || random.below(2) == 0) return LLVMFuzzerMutate(data, size, capacity);
  using namespace flexcomp;
  const std::size_t image_bytes = std::min<std::size_t>(load_u16(data + 2), size - prefix);
  struct Record {
    std::size_t at;
    std::size_t size;
  };
  std::vector<Record> records;
  for (std::size_t at = prefix + image::header_bytes; at + 8 <= prefix + image_bytes;) {
    const std::size_t length = image::record_head_bytes + load_u16(data + at + 2);
    if (at + length > prefix + image_bytes) break;
    records.push_back({at, length});
    at += length;
  }
  if (records.empty()) return LLVMFuzzerMutate(data, size, capacity);
  const Record r = records[random.below(records.size())];
  std::uint8_t* p = data + r.at;
  const bool is_term = load_u16(p) == image::record_term && r.size == 32;
  switch (random.below(6)) {
    case 0: {  // doubled
      if (size + r.size > capacity || image_bytes + r.size > 0xFFFF) return size;
      const Bytes copy(p, p + r.size);
      std::memmove(p + r.size, p, size - r.at);
      std::memcpy(p, copy.data(), copy.size());
      store_u16(data + 2, static_cast<std::uint16_t>(image_bytes + r.size));
      return size + r.size;
    }
    case 1:  // taken out
      std::memmove(p, p + r.size, size - r.at - r.size);
      store_u16(data + 2, static_cast<std::uint16_t>(image_bytes - r.size));
      return size - r.size;
    case 2:  // the integers of its head
      if (is_term) {
        static const std::uint8_t bodies[] = {0, 1, 2, 3, 4, 5, 6, 7, 32, 33, 0x40, 0x41, 0x42, 0xFF};
        const unsigned which = random.below(7);
        if (which == 0) p[4] = bodies[random.below(sizeof bodies)];
        if (which == 1) p[5] = static_cast<std::uint8_t>(random.below(8));
        if (which == 2) p[6] = static_cast<std::uint8_t>(random.below(basis_count + 2));
        if (which == 3) p[7] = static_cast<std::uint8_t>(random.below(9));
        if (which == 4) p[8] = static_cast<std::uint8_t>(random.below(6));
        if (which == 5) p[9] = static_cast<std::uint8_t>(random.below(40));
        if (which == 6) store_u16(p + 12, static_cast<std::uint16_t>(random.below(4)));
      } else if (r.size >= 12) {
        p[4 + random.below(8)] = static_cast<std::uint8_t>(random.below(7));
      }
      return size;
    default: {  // a number
      if (r.size < 20) return size;
      const std::size_t first = is_term ? 16 : 12;
      const std::size_t number = random.below((r.size - first) / 8);
      Bytes odd(10);
      for (std::uint8_t& b : odd) b = static_cast<std::uint8_t>(random());
      double v = Input(odd).odd_number();
      if (random.below(4) != 0)
        v = (static_cast<double>(random.below(2001)) - 1000) *
            std::pow(10.0, -static_cast<double>(random.below(12)));
      store_u64(p + first + 8 * number, bits_of(v));
      return size;
    }
  }
}

const Register registered({"image", run, seeds, mutate});

}  // namespace
}  // namespace fuzz::image_target
