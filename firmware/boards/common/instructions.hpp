// SPDX-License-Identifier: Apache-2.0
#pragma once
// Counts instructions in an emulator. It executes one instruction per fixed time (-icount), so a clock counts them
// exactly and repeatably. They are an instruction budget, not cycles: no real processor takes one cycle for each.
//   Cortex-M: timer 0 of the mps2 boards (25 MHz); at -icount shift=10 an instruction takes 1024 ns, 25.6 ticks
//   Cortex-R5F: the performance monitor's cycle counter (PMCCNTR, 1 GHz); at shift=0 one tick per instruction
#include <cstdint>

namespace flexcomp::boards {

#if defined(__ARM_ARCH_PROFILE) && __ARM_ARCH_PROFILE == 'M'

inline volatile std::uint32_t& timer_register(unsigned offset) {
  return *reinterpret_cast<volatile std::uint32_t*>(0x40000000U + offset);
}
inline void start_instruction_counter() {
  timer_register(0x0) = 0;
  timer_register(0x8) = 0xFFFFFFFFU;  // reload
  timer_register(0x4) = 0xFFFFFFFFU;  // counts down from here
  timer_register(0x0) = 1;
}
inline std::uint32_t ticks() { return ~timer_register(0x4); }
constexpr std::uint32_t ticks_per_10_instructions = 256;

#else

inline void start_instruction_counter() {
  std::uint32_t control;
  asm volatile("mrc p15, 0, %0, c9, c12, 0" : "=r"(control));
  control = (control | 1U | 4U) & ~8U;  // enable, reset the cycle counter, no division by 64
  asm volatile("mcr p15, 0, %0, c9, c12, 0" ::"r"(control));
  asm volatile("mcr p15, 0, %0, c9, c12, 1" ::"r"(0x80000000U));
}
inline std::uint32_t ticks() {
  std::uint32_t count;
  asm volatile("mrc p15, 0, %0, c9, c13, 0" : "=r"(count)::"memory");
  return count;
}
constexpr std::uint32_t ticks_per_10_instructions = 10;

#endif

/// Instructions between two readings, to the nearest; the reading's own are in it (take an empty pair away).
inline std::uint32_t instructions(std::uint32_t from, std::uint32_t to) {
  return static_cast<std::uint32_t>(
      (static_cast<std::uint64_t>(to - from) * 10U + ticks_per_10_instructions / 2U) /
      ticks_per_10_instructions);
}

}  // namespace flexcomp::boards
