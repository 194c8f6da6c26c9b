// SPDX-License-Identifier: Apache-2.0
// How much stack the calls really take, compared with the worst that figures.py works out: a pattern is written
// below the stack pointer, a call is made, and what is left of the pattern is counted. Prints "stack NAME 0x…".
#include <flexcomp.h>

#include <cstring>

#include "examples/tx60l.h"
#include "examples/tx60l_set.h"
#include "selftest.hpp"
#include "semihosting.hpp"

extern "C" {
extern std::uint32_t flexcomp_stack_bottom;
}

namespace {

constexpr std::uint32_t pattern = 0xA5C3D2E1U;
constexpr std::size_t seal_bytes = 32;

std::uint8_t slots[2][FLEXCOMP_SLOT_BYTES];
flexcomp_memory memory;
flexcomp_rtu_memory rtu_memory;
flexcomp_arm* arm;
flexcomp_rtu* rtu;
flexcomp_real q[6];
flexcomp_context context;

flexcomp_storage_result read_slot(void*, unsigned slot, std::uint32_t offset, std::uint8_t* to,
                                  std::uint32_t size) {
  std::memcpy(to, slots[slot] + offset, size);
  return FLEXCOMP_STORAGE_DONE;
}

void step() { flexcomp_step(arm, q, &context, q); }
void boot() { flexcomp_boot(arm); }
void receive() {
  const std::uint8_t request[8] = {1, 3, 0, 0, 0, 1, 0x84, 0x0A};
  flexcomp_rtu_receive(rtu, request, sizeof request, 0);
}
void send(void*, const std::uint8_t*, std::size_t) {}

/// Bytes below this function's own frame that `call` has written to.
[[gnu::noipa]] std::uint32_t taken_by(void (*call)()) {
  std::uint32_t top;  // the lowest address that is ours
  asm volatile("mov %0, sp" : "=r"(top));
  volatile std::uint32_t* bottom = &flexcomp_stack_bottom;
  for (volatile std::uint32_t* p = bottom; reinterpret_cast<std::uintptr_t>(p) < top; ++p) *p = pattern;
  call();
  volatile std::uint32_t* p = bottom;
  while (*p == pattern) ++p;
  return static_cast<std::uint32_t>(top - reinterpret_cast<std::uintptr_t>(p));
}

void say(const char* name, std::uint32_t bytes) {
  flexcomp::boards::write("stack ");
  flexcomp::boards::write(name);
  flexcomp::boards::write(" ");
  flexcomp::boards::write_hex(bytes);
  flexcomp::boards::write("\n");
}

}  // namespace

int main() {
  std::memcpy(slots[0], tx60l_image, sizeof tx60l_image);
  std::memcpy(slots[0] + FLEXCOMP_SLOT_BYTES - seal_bytes, tx60l_seal, seal_bytes);
  const flexcomp_storage storage = {nullptr, read_slot, nullptr, nullptr};
  arm = flexcomp_init(&memory, sizeof memory, &staubli_tx60l, nullptr, &storage);
  if (arm == nullptr) return 1;
  flexcomp_context_default(arm, &context);
  say("boot", taken_by(boot));
  std::uint32_t most = 0;
  for (const auto& command : selftest::commands) {
    for (std::size_t j = 0; j < 6; ++j) q[j] = static_cast<flexcomp_real>(command[j]) / flexcomp_real(64);
    const std::uint32_t taken = taken_by(step);
    if (taken > most) most = taken;
  }
  say("step", most);
  rtu = flexcomp_rtu_init(&rtu_memory, sizeof rtu_memory, arm, 1, 1750, send, nullptr);
  if (rtu == nullptr) return 2;
  say("rtu_receive", taken_by(receive));
  return 0;
}
