# SPDX-License-Identifier: Apache-2.0
# What the three Cortex targets share. Included by them after they have set
#   FLEXCOMP_CPU_FLAGS   which core and floating-point unit
#   FLEXCOMP_BOARD       the folder in firmware/boards that starts an image
#   FLEXCOMP_EMULATOR    the emulator's command line up to the image
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
find_program(CMAKE_NM arm-none-eabi-nm REQUIRED)
# A bare target has no start-up code of its own, so a trial program cannot be linked.
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)

# -ffp-contract=off comes with flexcomp::core; it is repeated for the sources that do not link it.
string(CONCAT flexcomp_common
  "${FLEXCOMP_CPU_FLAGS} -ffunction-sections -fdata-sections -ffp-contract=off -fno-math-errno -fstack-usage")
set(CMAKE_C_FLAGS_INIT "${flexcomp_common}")
set(CMAKE_ASM_FLAGS_INIT "${FLEXCOMP_CPU_FLAGS}")
set(CMAKE_CXX_FLAGS_INIT
  "${flexcomp_common} -fno-exceptions -fno-rtti -fno-threadsafe-statics -fno-use-cxa-atexit")
set(CMAKE_EXE_LINKER_FLAGS_INIT
  "${FLEXCOMP_CPU_FLAGS} --specs=nano.specs -nostartfiles -Wl,--gc-sections -Wl,-z,noexecstack -Wl,--fatal-warnings")

# -O2 whatever the build type: at -Os Eigen is no longer inlined, which made a 6-DOF step 2.4 times slower and
# larger; and no NDEBUG, because asserts go to the firmware's own fault hook.
foreach(type DEBUG RELEASE RELWITHDEBINFO MINSIZEREL)
  set(CMAKE_C_FLAGS_${type} "-O2 -g1" CACHE STRING "" FORCE)
  set(CMAKE_CXX_FLAGS_${type} "-O2 -g1" CACHE STRING "" FORCE)
endforeach()

set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_CROSSCOMPILING_EMULATOR ${FLEXCOMP_EMULATOR})
