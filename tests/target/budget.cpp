// The instruction budget of the control step: 39 terms, then 200 calls of flexcomp_step with random joint commands, each
// from a cold start (nothing of one command helps the next). Prints what each took; an outside count from
// the entry of flexcomp_step to its return gives the same.
#include "budget_arm.hpp"
#include "instructions.hpp"
#include "print.hpp"

namespace {

alignas(8) flexcomp_memory memory;
budget::Storage storage;
volatile int nothing;

}  // namespace

int main() {
  flexcomp_settings settings;
  flexcomp_settings_default(&settings);
  settings.fade_cycles = 1;  // budget_parts measures what fading costs
  flexcomp_arm* arm = budget::start(memory, storage, 0, &settings);
  if (arm == nullptr) return 1;
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
    budget::Scalar q[6];
    commands.next(q);
    from = ticks();
    const flexcomp_status status = flexcomp_step(arm, q, nullptr, q);
    const std::uint32_t count = instructions(from + own, ticks());
    if (status >= FLEXCOMP_NO_SET) return 2;
    if (count < least) least = count;
    if (count > most) most = count;
    sum += count;
  }
  print("step, 39 terms: least ", least, " mean ", sum / calls, " most ", most, " instructions\n");
  return 0;
}
