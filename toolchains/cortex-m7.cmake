# SPDX-License-Identifier: Apache-2.0
# Cortex-M7 with a double-precision unit, in double.
set(FLEXCOMP_CPU_FLAGS "-mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard -mthumb")
set(FLEXCOMP_BOARD mps2-an500)
set(FLEXCOMP_SCALAR double)
set(FLEXCOMP_EMULATOR qemu-system-arm -M mps2-an500 -display none -monitor none -serial none -icount shift=2
    -semihosting-config enable=on,target=native -kernel)
include("${CMAKE_CURRENT_LIST_DIR}/arm-none-eabi.cmake")
