# SPDX-License-Identifier: Apache-2.0
# Cortex-M4F: its unit knows float only, so everything is float, and a stray double is refused at link time.
set(FLEXCOMP_CPU_FLAGS "-mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard -mthumb")
set(FLEXCOMP_BOARD mps2-an386)
set(FLEXCOMP_SCALAR float)
set(FLEXCOMP_EMULATOR qemu-system-arm -M mps2-an386 -display none -monitor none -serial none -icount shift=2
    -semihosting-config enable=on,target=native -kernel)
include("${CMAKE_CURRENT_LIST_DIR}/arm-none-eabi.cmake")
