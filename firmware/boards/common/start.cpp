// SPDX-License-Identifier: Apache-2.0
// What every image does between reset and main: memory, constructors, main, and its result as exit status.
// The reset entry of each board sets the stack and the floating-point unit and then comes here.
#include <cstdint>

#include "semihosting.hpp"

extern "C" {
extern std::uint32_t flexcomp_data_load, flexcomp_data_begin, flexcomp_data_end;
extern std::uint32_t flexcomp_bss_begin, flexcomp_bss_end;
using Constructor = void (*)();
extern Constructor flexcomp_constructors_begin, flexcomp_constructors_end;

// The program's main under a name that C++ allows to be called.
int flexcomp_program() asm("main");

[[noreturn]] void flexcomp_board_start() {
  const std::uint32_t* from = &flexcomp_data_load;
  for (std::uint32_t* to = &flexcomp_data_begin; to != &flexcomp_data_end;) *to++ = *from++;
  for (std::uint32_t* to = &flexcomp_bss_begin; to != &flexcomp_bss_end;) *to++ = 0;
  for (Constructor* c = &flexcomp_constructors_begin; c != &flexcomp_constructors_end; ++c) (*c)();
  flexcomp::boards::exit(flexcomp_program());
}

/// Any exception or fault of the processor ends the run at once with a status of its own.
[[noreturn]] void flexcomp_board_fault() {
  flexcomp::boards::write("fault: the processor took an unexpected exception\n");
  flexcomp::boards::exit(99);
}

/// A pure virtual call would be a programming error; without this the C++ library brings its own terminate.
[[noreturn]] void __cxa_pure_virtual() { flexcomp_board_fault(); }

/// What newlib's assert() calls. newlib's own prints, and brings a heap to do so.
[[noreturn]] void __assert_func(const char* file, int, const char*, const char* condition) {
  flexcomp::boards::write("assertion failed: ");
  flexcomp::boards::write(condition);
  flexcomp::boards::write(" in ");
  flexcomp::boards::write(file);
  flexcomp::boards::write("\n");
  flexcomp::boards::exit(98);
}

/// Where an assertion of the library or of Eigen ends (FLEXCOMP_FAULT): the library itself is wrong. A real
/// controller stops its drives here.
[[noreturn]] void flexcomp_fault() {
  flexcomp::boards::write("fault: an assertion of the library failed\n");
  flexcomp::boards::exit(97);
}

/// newlib's abort would pull in signals.
[[noreturn]] void abort() { flexcomp_board_fault(); }
}
