// SPDX-License-Identifier: Apache-2.0
// Prints what the firmware library, built for the scalar of FLEXCOMP_SCALAR, answers on the host:
//   print_protocol            CRC-32 of every entry of the transcript that targets must reach (golden_protocol_*.hpp)
//   print_protocol entries    the entries themselves, to see what a target that differs should have answered
//   print_protocol set        a set as it lies in a slot, for the examples (firmware/examples/tx60l_set.h)
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <memory>

#include "examples/tx60l.h"
#include "flexcomp/compensate.hpp"
#include "protocol.hpp"

namespace {

/// An exchange that only collected refusals would be equal everywhere and say nothing.
const char* what_is_missing(const protocol::Transcript& t) {
  unsigned corrected = 0;
  unsigned exceptions = 0;
  unsigned aborts = 0;
  std::uint32_t sequences[8] = {};
  unsigned states = 0;
  t.each([&](const std::uint8_t* entry, std::size_t size) {
    const std::uint8_t* bytes = entry + 3;
    if (entry[0] == 'Q' && bytes[0] == FLEXCOMP_OK) ++corrected;
    if (entry[0] == 'R' && (bytes[1] & 0x80U) != 0) ++exceptions;
    if (entry[0] == 'C' && size > 6 && bytes[3] == 0x80) ++aborts;
    if (entry[0] == 'S' && states < 8) sequences[states++] = flexcomp::load_u32(bytes);
  });
  if (t.full) return "the transcript is too small";
  if (corrected < 30) return "commands were not corrected";
  if (exceptions != 4) return "four exceptions of Modbus, no more";
  if (aborts != 2) return "two aborts of CANopen, no more";
  if (states != 4 || sequences[0] != 0 || sequences[1] != 8 || sequences[2] != 7 || sequences[3] != 7)
    return "the sets did not become active in turn";
  return nullptr;
}

void print_bytes(const char* type, const char* name, const std::uint8_t* bytes, std::size_t size) {
  std::printf("%s %s[%zu] = {", type, name, size);
  for (std::size_t k = 0; k < size; ++k)
    std::printf("%s%u", k == 0 ? "\n    " : k % 32 == 0 ? ",\n    " : ", ", static_cast<unsigned>(bytes[k]));
  std::printf("};\n");
}

void print_entries(const protocol::Transcript& transcript) {
  std::size_t k = 0;
  transcript.each([&](const std::uint8_t* entry, std::size_t size) {
    std::printf("%zu %c", k++, entry[0]);
    for (std::size_t i = 3; i < size; ++i) std::printf(" %02x", static_cast<unsigned>(entry[i]));
    std::printf("\n");
  });
}

void print_checksums(const protocol::Transcript& transcript) {
  std::printf(
      "#pragma once\n// Printed by print_protocol.cpp on the host; \"cmake --build --preset host --target "
      "golden\" "
      "writes it anew.\n// clang-format off\n#include <cstdint>\n\nnamespace golden {\n\n"
      "constexpr std::uint32_t protocol_in_%s[] = {",
      sizeof(flexcomp_real) == 4 ? "float" : "double");
  std::size_t k = 0;
  transcript.each([&](const std::uint8_t* entry, std::size_t size) {
    std::printf("%s0x%08" PRIx32,
                k == 0        ? "\n    "
                : k % 12 == 0 ? ",\n    "
                              : ", ",
                flexcomp::crc32(entry, size));
    ++k;
  });
  std::printf("};\n\n}  // namespace golden\n");
}

int print_set(const selftest::Image& image, const protocol::Exchange& exchange) {
  // The command whose context in the self-test is the default one.
  constexpr std::size_t chosen = 2;
  flexcomp::NominalRobot<6> robot = selftest::tx60l();
  auto model = std::make_unique<flexcomp::Model<double>>();
  if (flexcomp::model_from_image(image.data(), image.size(), robot, *model) != flexcomp::Refusal::none)
    return 1;
  std::array<double, 6> q{};
  for (std::size_t i = 0; i < 6; ++i) q[i] = selftest::commands[chosen][i] / 64.0;
  const flexcomp::Compensated<double, 6> corrected =
      flexcomp::compensate(*model, q, flexcomp::default_context<double>(robot));
  if (corrected.status != flexcomp::StepStatus::ok) return 1;
  std::printf(
      "/* A parameter set for the TX60L (Table 1 of Chen et al. 2019 and a curve) as it lies in a slot of a\n"
      " * controller's non-volatile memory, a joint command, and what the host makes of that command with "
      "the set.\n"
      " * Printed by tests/target/print_protocol.cpp; \"cmake --build --preset host --target golden\" writes "
      "it\n"
      " * anew. */\n/* clang-format off */\n"
      "#ifndef FLEXCOMP_SET_TX60L_H\n#define FLEXCOMP_SET_TX60L_H\n\n#include <flexcomp.h>\n\n");
  std::printf("/* The image: a slot's first bytes. */\n");
  print_bytes("static const uint8_t", "tx60l_image", image.data(), image.size());
  std::printf("\n/* The seal: a slot's last 32 bytes. */\n");
  constexpr std::size_t seal = 32;
  print_bytes("static const uint8_t", "tx60l_seal", exchange.slot(0).data() + FLEXCOMP_SLOT_BYTES - seal,
              seal);
  const auto print_joints = [](const char* name, const std::array<double, 6>& joints) {
    std::printf("\nstatic const flexcomp_real %s[FLEXCOMP_JOINTS] = {", name);
    for (std::size_t i = 0; i < 6; ++i) std::printf("%s(flexcomp_real)%.17g", i == 0 ? "" : ", ", joints[i]);
    std::printf("};\n");
  };
  print_joints("tx60l_command_rad", q);
  print_joints("tx60l_corrected_rad", corrected.q);
  std::printf("\n#endif\n");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const auto transcript = std::make_unique<protocol::Transcript>();
  const auto exchange = std::make_unique<protocol::Exchange>(*transcript);
  selftest::Image image{};
  if (selftest::make_image<double>(image) != image.size() || !exchange->run(staubli_tx60l, image)) {
    std::fprintf(stderr, "the exchange does not get to its end\n");
    return 1;
  }
  if (const char* missing = what_is_missing(*transcript)) {
    std::fprintf(stderr, "%s\n", missing);
    return 1;
  }
  if (argc == 2 && std::strcmp(argv[1], "set") == 0) return print_set(image, *exchange);
  if (argc == 2 && std::strcmp(argv[1], "entries") == 0) {
    print_entries(*transcript);
  } else {
    print_checksums(*transcript);
  }
  return 0;
}
