// SPDX-License-Identifier: Apache-2.0
// A sample of tests/firmware/motion_test.cpp on the target: random commands through limits, reversals and poses beside
// singularities, jumps of the load, commands that are not numbers. In every cycle the correction keeps its rate, the joints
// their limits, a refused command stands, and what goes out is finite. Ends with the number of the bound that broke.
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "../../firmware/examples/tx60l.h"
#include "../../firmware/examples/tx60l_set.h"

namespace {

using Real = flexcomp_real;
constexpr unsigned joints = FLEXCOMP_JOINTS;
constexpr unsigned cycles = 20000;
constexpr Real rate_rad = Real(2e-3F);  // the default of 2 rad/s in a cycle of 1 ms

std::uint8_t slot_bytes[FLEXCOMP_SLOT_BYTES];
flexcomp_memory memory;

flexcomp_storage_result read_slot(void*, unsigned slot, std::uint32_t offset, std::uint8_t* to,
                                  std::uint32_t size) {
  for (std::uint32_t k = 0; k < size; ++k) to[k] = slot == 0 ? slot_bytes[offset + k] : 0xFF;
  return FLEXCOMP_STORAGE_DONE;
}

std::uint32_t state = 2019;
std::uint32_t bits() {
  state ^= state << 13U;
  state ^= state >> 17U;
  state ^= state << 5U;
  return state;
}
/// In [-1, 1).
Real unit() { return static_cast<Real>(static_cast<std::int32_t>(bits() >> 8U) - 8388608) / Real(8388608); }

}  // namespace

int main() {
  std::memset(slot_bytes, 0xFF, sizeof slot_bytes);
  std::memcpy(slot_bytes, tx60l_image, sizeof tx60l_image);
  std::memcpy(slot_bytes + FLEXCOMP_SLOT_BYTES - sizeof tx60l_seal, tx60l_seal, sizeof tx60l_seal);
  flexcomp_storage storage{};
  storage.read = read_slot;
  flexcomp_settings settings;
  flexcomp_settings_default(&settings);
  settings.cycle_us = 1000;
  flexcomp_arm* arm = flexcomp_init(&memory, sizeof memory, &staubli_tx60l, &settings, &storage);
  if (arm == nullptr || flexcomp_boot(arm) != 0) return 1;
  flexcomp_context load;
  flexcomp_context_default(arm, &load);

  Real q[joints]{}, speed[joints]{}, lower[joints]{}, upper[joints]{}, out[joints]{}, last[joints]{},
      correction[joints]{};
  for (unsigned j = 0; j < joints; ++j) {
    lower[j] = static_cast<Real>(staubli_tx60l.min_rad[j]);
    upper[j] = static_cast<Real>(staubli_tx60l.max_rad[j]);
  }
  std::uint32_t seen = 0;
  unsigned usual = 0;
  bool held = true;
  for (unsigned n = 0; n < cycles; ++n) {
    if (n % 300 == 0) {
      for (Real& s : speed) s = unit() * Real(2e-3F);
      if (n % 1200 == 0) q[4] = unit() * Real(0.01F);  // a jump, to beside the wrist's singularity
      load.payload_kg = Real(4) + Real(4) * unit();
      load.force_n[bits() % 3U] = Real(500) * unit();
    }
    for (unsigned j = 0; j < joints; ++j) {
      q[j] += speed[j];
      if (!(q[j] > lower[j] && q[j] < upper[j])) {
        q[j] = q[j] > 0 ? upper[j] : lower[j];
        speed[j] = -speed[j];
      }
    }
    Real command[joints];
    for (unsigned j = 0; j < joints; ++j) command[j] = q[j];
    const bool bad = bits() % 100U == 0;
    if (bad) {
      command[bits() % joints] = bits() % 2U == 0 ? std::numeric_limits<Real>::quiet_NaN() : Real(1e30F);
    }
    const flexcomp_status status = flexcomp_step(arm, command, &load, out);
    const std::uint32_t flags = flexcomp_step_flags(arm);
    seen |= flags;
    if ((status == FLEXCOMP_OK) != (flags == 0)) return 2;
    if (flags == 0) ++usual;
    if (bad != (status == FLEXCOMP_REFUSED)) return 3;
    for (unsigned j = 0; j < joints; ++j) {
      if (!(out[j] >= lower[j] && out[j] <= upper[j])) return 4;
      if (bad) {
        if (n != 0 && std::memcmp(&out[j], &last[j], sizeof(Real)) != 0) return 5;
        continue;
      }
      const Real c = out[j] - command[j];
      const Real stands = std::fabs(command[j] + correction[j]);
      const Real limit = command[j] > 0 ? upper[j] : -lower[j];
      const Real forced = stands > limit ? stands - limit : Real(0);
      if (!held && !(std::fabs(c - correction[j]) <= rate_rad * Real(1.0001F) + forced + Real(2e-6F)))
        return 6;
      correction[j] = c;
    }
    for (unsigned j = 0; j < joints; ++j) last[j] = out[j];
    held = bad;
  }
  // Everything was met, and most of the way nothing held back.
  const std::uint32_t wanted =
      FLEXCOMP_FLAG_REFUSED | FLEXCOMP_FLAG_AT_LIMIT | FLEXCOMP_FLAG_SETTLING | FLEXCOMP_FLAG_NEAR_SINGULAR;
  if ((seen & wanted) != wanted) return 7;
  return usual > cycles / 10 ? 0 : 8;
}
