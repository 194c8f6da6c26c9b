// SPDX-License-Identifier: Apache-2.0
#pragma once
// Output and end of an image that runs in an emulator, by Arm's semihosting calls. A real controller has
// neither: this is board code of the emulated machines, never part of the firmware library.
#include <cstdint>

namespace flexcomp::boards {

/// One semihosting call: `operation` by number, `argument` as the call defines it.
inline int semihosting(int operation, const void* argument) {
  register int r0 asm("r0") = operation;
  register const void* r1 asm("r1") = argument;
#if defined(__thumb__)
#if __ARM_ARCH_PROFILE == 'M'
  asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory", "lr");
#else
  asm volatile("svc 0xab" : "+r"(r0) : "r"(r1) : "memory", "lr");
#endif
#else
  asm volatile("svc 0x123456" : "+r"(r0) : "r"(r1) : "memory", "lr");
#endif
  return r0;
}

/// Writes a zero-terminated text to the emulator's standard error.
inline void write(const char* text) { semihosting(0x04, text); }

/// Writes a number as 0x and 16 digits.
inline void write_hex(std::uint64_t value) {
  char text[19] = "0x";
  for (int i = 0; i < 16; ++i) text[2 + i] = "0123456789abcdef"[(value >> (60 - 4 * i)) & 0xFU];
  text[18] = 0;
  write(text);
}

/// Ends the emulator with this exit status (SYS_EXIT_EXTENDED, reason ADP_Stopped_ApplicationExit).
[[noreturn]] inline void exit(int status) {
  const std::uint32_t block[2] = {0x20026U, static_cast<std::uint32_t>(status)};
  for (;;) semihosting(0x20, block);
}

}  // namespace flexcomp::boards
