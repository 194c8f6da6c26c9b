// SPDX-License-Identifier: Apache-2.0
// The instruction budget of the control step: 39 terms, then 200 calls of flexcomp_step with random joint commands at
// which the smallest singular value of the Jacobian is at least 0.1 (m), each from a cold start (nothing of one command
// helps the next). Prints what each took; an outside count from the entry of flexcomp_step to its return gives the same.
#include "budget_arm.hpp"
#include "instructions.hpp"
#include "print.hpp"

namespace {

alignas(8) flexcomp_memory memory;
budget::Storage storage;
flexcomp::Model<budget::Scalar, 6, flexcomp::Capacity<1, 1, 6>> nominal;
volatile int nothing;

}  // namespace

int main() {
  flexcomp_settings settings;
  flexcomp_settings_default(&settings);
  // Each command is far from the one before, and its whole correction is wanted at once: in a cycle of a second no rate
  // holds it back.
  settings.cycle_us = 1000000;
  flexcomp_arm* arm = budget::start(memory, storage, budget::Set::paper, &settings);
  if (arm == nullptr) return 1;
  nominal.begin(selftest::tx60l());
  nominal.finish();
  using flexcomp::boards::instructions;
  using flexcomp::boards::ticks;
  flexcomp::boards::start_instruction_counter();
  std::uint32_t from = ticks();
  nothing = 0;
  const std::uint32_t own = ticks() - from;
  budget::Commands commands(1);
  std::uint32_t least = ~0U, most = 0, sum = 0;
  constexpr std::uint32_t calls = 200;
  for (std::uint32_t k = 0; k < calls; ++k) {
    std::array<budget::Scalar, 6> q;
    do {
      commands.next(q.data());
    } while (!budget::is_regular(nominal, q));
    from = ticks();
    const flexcomp_status status = flexcomp_step(arm, q.data(), nullptr, q.data());
    const std::uint32_t count = instructions(from + own, ticks());
    if (status >= FLEXCOMP_NO_SET) return 2;
    if (count < least) least = count;
    if (count > most) most = count;
    sum += count;
  }
  print("step, 39 terms: least ", least, " mean ", sum / calls, " most ", most, " instructions\n");
  return 0;
}
