// SPDX-License-Identifier: Apache-2.0
// The core on a target against the host: image, forward model, columns of H and compensation bit by
// bit, in the target's scalar; in float besides within a tolerance of the double result.
#include <cstring>

#include "golden.hpp"
#include "selftest.hpp"
#include "semihosting.hpp"

namespace {

using Scalar = FLEXCOMP_SCALAR;
constexpr bool in_float = sizeof(Scalar) == 4;

// Of a float result against the double one. An arm of 1 m in float resolves 6e-8 m; some 60 operations make a pose.
// A corrected joint is a difference of poses divided by a singular value; at the wrist singularity the two scalars
// may damp a little differently, so only regular poses are compared there.
constexpr float pose_tolerance = 1e-6F;
constexpr float joint_tolerance = 4e-6F;
// Columns are levers (at most 1.1 m) and axes, times the basis: relative to the column's largest number.
constexpr float column_tolerance = 4e-6F;

bool fail(const char* what, std::size_t command, std::size_t number, std::uint64_t expected,
          std::uint64_t got) {
  flexcomp::boards::write(what);
  flexcomp::boards::write(": command ");
  flexcomp::boards::write_hex(command);
  flexcomp::boards::write(" number ");
  flexcomp::boards::write_hex(number);
  flexcomp::boards::write(" expected ");
  flexcomp::boards::write_hex(expected);
  flexcomp::boards::write(" got ");
  flexcomp::boards::write_hex(got);
  flexcomp::boards::write("\n");
  return false;
}

[[maybe_unused]] std::uint64_t bits(double v) { return flexcomp::bits_of(v); }
[[maybe_unused]] std::uint64_t bits(float v) {
  std::uint32_t b;
  std::memcpy(&b, &v, sizeof b);
  return b;
}

/// A double result of the host, as a target with float would hold it.
[[maybe_unused]] float in_single(std::uint64_t bits_of_double) {
  return flexcomp::from_binary64<float>(flexcomp::double_of(bits_of_double));
}

[[maybe_unused]] float size_of(float v) { return v < 0 ? -v : v; }

bool images_agree() {
  const std::uint8_t* bytes = golden::image.data();
  const std::size_t without_crc = golden::image.size() - flexcomp::image::crc_bytes;
  const std::uint32_t crc = flexcomp::crc32(bytes, without_crc);
  if (crc != golden::image_crc) return fail("CRC of the image", 0, 0, golden::image_crc, crc);
  if constexpr (!in_float) {
    static selftest::Image image;
    if (selftest::make_image<Scalar>(image) != image.size())
      return fail("size of the image", 0, 0, image.size(), 0);
    for (std::size_t k = 0; k < image.size(); ++k) {
      if (image[k] != bytes[k]) return fail("byte of the image", 0, k, bytes[k], image[k]);
    }
  }
  return true;
}

bool results_agree() {
  static selftest::Results<Scalar> results;
  selftest::evaluate(golden::image, results);
  if (results.refusal != flexcomp::Refusal::none)
    return fail(text(results.refusal), 0, 0, 0, static_cast<std::uint64_t>(results.refusal));
  for (std::size_t k = 0; k < selftest::command_count; ++k) {
    const std::uint8_t status = in_float ? golden::status_in_float[k] : golden::status_in_double[k];
    if (results.status[k] != status) return fail("status", k, 0, status, results.status[k]);
    for (std::size_t i = 0; i < selftest::numbers_per_command; ++i) {
      const Scalar got = results.numbers[k][i];
      const std::uint64_t expected = in_float ? golden::in_float[k][i] : golden::in_double[k][i];
      if (bits(got) != expected) return fail("bits", k, i, expected, bits(got));
      if constexpr (in_float) {
        const float exact = in_single(golden::in_double[k][i]);
        const float off = size_of(got - exact);
        const bool joint = i >= 12;
        if (joint && static_cast<flexcomp::StepStatus>(status) != flexcomp::StepStatus::ok) continue;
        if (!(off <= (joint ? joint_tolerance : pose_tolerance)))
          return fail("tolerance", k, i, bits(exact), bits(got));
      }
    }
  }
  for (std::size_t c = 0; c < selftest::column_command_count; ++c) {
    for (std::size_t e = 0; e < selftest::entry_count; ++e) {
      float largest = 0;
      for (std::size_t i = 0; i < 6; ++i) {
        const Scalar got = results.columns[c][e][i];
        const std::uint64_t expected =
            in_float ? golden::columns_in_float[c][e][i] : golden::columns_in_double[c][e][i];
        if (bits(got) != expected) return fail("column of H", c, 6 * e + i, expected, bits(got));
        if constexpr (in_float) {
          const float size = size_of(in_single(golden::columns_in_double[c][e][i]));
          if (size > largest) largest = size;
        }
      }
      for (std::size_t i = 0; i < 6 && in_float; ++i) {
        const float got = in_single(flexcomp::to_binary64_bits(results.columns[c][e][i]));
        const float exact = in_single(golden::columns_in_double[c][e][i]);
        if (!(size_of(got - exact) <= column_tolerance * largest))
          return fail("tolerance of a column of H", c, 6 * e + i, bits(exact), bits(got));
      }
    }
  }
  return true;
}

}  // namespace

int main() {
  if (!images_agree() || !results_agree()) return 1;
  flexcomp::boards::write("core: image, forward model, columns of H and compensation agree with the host\n");
  return 0;
}
