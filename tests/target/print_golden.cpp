// SPDX-License-Identifier: Apache-2.0
// Prints golden.hpp: what the host gets, in double and in float, bit by bit.
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <type_traits>

#include "target/selftest.hpp"

namespace {

/// The bits of numbers as a row of an array.
template <class Row>
void print_row(const Row& row) {
  std::printf("    {");
  for (std::size_t i = 0; i < row.size(); ++i) {
    std::conditional_t<sizeof row[i] == 8, std::uint64_t, std::uint32_t> bits;
    std::memcpy(&bits, &row[i], sizeof bits);
    std::printf("%s0x%0*" PRIx64, i == 0 ? "" : ", ", static_cast<int>(2 * sizeof bits),
                static_cast<std::uint64_t>(bits));
  }
  std::printf("},\n");
}

template <class S>
void print(const selftest::Results<S>& results, const char* type, const char* name) {
  std::printf("constexpr %s %s[%zu][%zu] = {\n", type, name, selftest::command_count,
              selftest::numbers_per_command);
  for (const auto& row : results.numbers) print_row(row);
  std::printf("};\n");
}

template <class S>
void print_columns(const selftest::Results<S>& results, const char* type, const char* name) {
  std::printf("constexpr %s %s[%zu][%zu][6] = {\n", type, name, selftest::column_command_count,
              selftest::entry_count);
  for (const auto& columns : results.columns) {
    std::printf("  {\n");
    for (const auto& column : columns) print_row(column);
    std::printf("  },\n");
  }
  std::printf("};\n");
}

template <class S>
void print_status(const selftest::Results<S>& results, const char* name) {
  std::printf("constexpr std::uint8_t %s[%zu] = {", name, selftest::command_count);
  for (std::size_t k = 0; k < results.status.size(); ++k)
    std::printf("%s%u", k == 0 ? "" : ", ", static_cast<unsigned>(results.status[k]));
  std::printf("};\n");
}

}  // namespace

int main() {
  selftest::Image image{};
  if (selftest::make_image<double>(image) != image.size()) return 1;
  static selftest::Results<double> in_double;
  static selftest::Results<float> in_float;
  selftest::evaluate(image, in_double);
  selftest::evaluate(image, in_float);
  if (in_double.refusal != flexcomp::Refusal::none || in_float.refusal != flexcomp::Refusal::none) return 2;

  std::printf(
      "#pragma once\n"
      "// Printed by print_golden.cpp on the host; \"cmake --build --preset host --target golden\" writes it "
      "anew.\n"
      "// clang-format off\n"
      "#include <cstdint>\n\n#include \"selftest.hpp\"\n\nnamespace golden {\n\n");
  std::printf("constexpr std::uint32_t image_crc = 0x%08" PRIx32 ";\n",
              flexcomp::load_u32(image.data() + image.size() - flexcomp::image::crc_bytes));
  std::printf("constexpr selftest::Image image = {{");
  for (std::size_t k = 0; k < image.size(); ++k)
    std::printf("%s0x%02x",
                k == 0        ? "\n    "
                : k % 24 == 0 ? ",\n    "
                              : ", ",
                static_cast<unsigned>(image[k]));
  std::printf("}};\n\n");
  print(in_double, "std::uint64_t", "in_double");
  print_status(in_double, "status_in_double");
  print_columns(in_double, "std::uint64_t", "columns_in_double");
  print(in_float, "std::uint32_t", "in_float");
  print_status(in_float, "status_in_float");
  print_columns(in_float, "std::uint32_t", "columns_in_float");
  std::printf("\n}  // namespace golden\n");
  return 0;
}
