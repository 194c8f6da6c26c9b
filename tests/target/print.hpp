// SPDX-License-Identifier: Apache-2.0
#pragma once
// Text and whole numbers to the emulator's standard error.
#include <cstdint>

#include "semihosting.hpp"

inline void print_one(const char* text) { flexcomp::boards::write(text); }
inline void print_one(std::uint32_t number) {
  char text[11];
  char* p = text + 10;
  *p = 0;
  do {
    *--p = static_cast<char>('0' + number % 10U);
    number /= 10U;
  } while (number != 0);
  flexcomp::boards::write(p);
}
template <class... Parts>
inline void print(Parts... parts) {
  (print_one(parts), ...);
}
