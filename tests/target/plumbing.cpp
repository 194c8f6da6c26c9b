// SPDX-License-Identifier: Apache-2.0
// Tests start-up from reset to exit: memory is set up, constructors have run, the floating-point unit works.
#include <cstdint>

#include "semihosting.hpp"

namespace {
volatile std::uint32_t initialised = 0x12345678U;
volatile std::uint32_t zeroed;
struct Constructed {
  std::uint32_t value;
  explicit Constructed(std::uint32_t v) : value(v) {}
};
volatile std::uint32_t seed = 41;
const Constructed constructed{seed + 1};
volatile float one_third = 1.0F / 3.0F;
}  // namespace

int main() {
  if (initialised != 0x12345678U) return 1;
  if (zeroed != 0) return 2;
  if (constructed.value != 42) return 3;
  if (one_third * 3.0F != 1.0F) return 4;
  flexcomp::boards::write("plumbing: memory, constructors and floating point are set up\n");
  return 0;
}
