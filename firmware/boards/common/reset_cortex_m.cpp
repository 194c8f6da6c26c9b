// Cortex-M: vector table and reset entry. The stack pointer comes from the table's first word.
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

struct Vectors {
  const void* stack;
  void (*entry[15])();
};
// Only the processor reads it; the linker script keeps the section.
extern const Vectors flexcomp_vectors;
[[gnu::section(".vectors")]] const Vectors flexcomp_vectors = {
    &flexcomp_stack_top,
    {flexcomp_reset, flexcomp_board_fault, flexcomp_board_fault, flexcomp_board_fault, flexcomp_board_fault,
     flexcomp_board_fault, nullptr, nullptr, nullptr, nullptr, flexcomp_board_fault, flexcomp_board_fault,
     nullptr, flexcomp_board_fault, flexcomp_board_fault}};
}
