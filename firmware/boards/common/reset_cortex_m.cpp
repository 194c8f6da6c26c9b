// SPDX-License-Identifier: Apache-2.0
// Cortex-M: vector table and reset entry. The stack pointer comes from the table's first word.
//
// An image that has a SysTick or peripherals with interrupts defines flexcomp_board_systick() and
// flexcomp_board_interrupt(); in every other image an interrupt is as unexpected as a fault.
#include <cstdint>

extern "C" {
extern std::uint32_t flexcomp_stack_top;
[[noreturn]] void flexcomp_board_start();
[[noreturn]] void flexcomp_board_fault();

[[noreturn]] void flexcomp_reset() {
  // CPACR: full access to coprocessors 10 and 11, before the first floating-point instruction.
  *reinterpret_cast<volatile std::uint32_t*>(0xE000ED88U) |= 0xFU << 20U;
  asm volatile("dsb\n isb" ::: "memory");
  flexcomp_board_start();
}

void flexcomp_board_systick();
/// All interrupts of peripherals; which one it is stands in the processor's IPSR (16 + number).
void flexcomp_board_interrupt();
[[gnu::weak]] void flexcomp_board_systick() { flexcomp_board_fault(); }
[[gnu::weak]] void flexcomp_board_interrupt() { flexcomp_board_fault(); }

struct Vectors {
  const void* stack;
  void (*entry[15])();
  void (*interrupt[32])();
};
// Only the processor reads it; the linker script keeps the section.
extern const Vectors flexcomp_vectors;
[[gnu::section(".vectors")]] const Vectors flexcomp_vectors = {
    &flexcomp_stack_top,
    {flexcomp_reset, flexcomp_board_fault, flexcomp_board_fault, flexcomp_board_fault, flexcomp_board_fault,
     flexcomp_board_fault, nullptr, nullptr, nullptr, nullptr, flexcomp_board_fault, flexcomp_board_fault,
     nullptr, flexcomp_board_fault, flexcomp_board_systick},
#define FOUR \
  flexcomp_board_interrupt, flexcomp_board_interrupt, flexcomp_board_interrupt, flexcomp_board_interrupt
    {FOUR, FOUR, FOUR, FOUR, FOUR, FOUR, FOUR, FOUR}};
#undef FOUR
}
