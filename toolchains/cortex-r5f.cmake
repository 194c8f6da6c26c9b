# SPDX-License-Identifier: Apache-2.0
# Cortex-R5F with a double-precision unit, in double. Thumb: the library is a quarter smaller than in ARM state.
# CPU, memory and semihosting, no peripherals.
set(FLEXCOMP_CPU_FLAGS "-mcpu=cortex-r5 -mfpu=vfpv3-d16 -mfloat-abi=hard -mthumb")
set(FLEXCOMP_BOARD cortex-r5f-bare)
set(FLEXCOMP_SCALAR double)
set(FLEXCOMP_EMULATOR sh "${CMAKE_CURRENT_LIST_DIR}/qemu-r5f.sh")
include("${CMAKE_CURRENT_LIST_DIR}/arm-none-eabi.cmake")
