# SPDX-License-Identifier: Apache-2.0
# The two installations of the library for a firmware engineer, with the board of this target: the installed package with its toolchain
# file, and a build without our CMake (docs/targets.md).
set(boards "${PROJECT_SOURCE_DIR}/firmware/boards")
get_target_property(board_sources flexcomp_board SOURCES)
list(TRANSFORM board_sources REPLACE "^([^/].*)$" "${boards}/\\1")
set(board_link "-L${boards}/common" "-T${boards}/${FLEXCOMP_BOARD}/board.ld" "-T${FLEXCOMP_RULES_DIR}/no_heap.ld")
set(structure "${PROJECT_SOURCE_DIR}/tests/structure")

add_test(NAME target/installed_package
  COMMAND bash "${structure}/installed_package_test.sh" ${CMAKE_BINARY_DIR} "${structure}/consumer"
    -D CMAKE_TOOLCHAIN_FILE=${CMAKE_TOOLCHAIN_FILE} "-DBOARD_SOURCES=${board_sources}"
    -D BOARD_INCLUDE=${boards}/common "-DBOARD_LINK_OPTIONS=${board_link}"
    -D EIGEN3_INCLUDE_DIR=${FLEXCOMP_EIGEN3_DIR} -- ${CMAKE_CROSSCOMPILING_EMULATOR})

separate_arguments(link UNIX_COMMAND "${CMAKE_EXE_LINKER_FLAGS}")
list(JOIN link " " link)
list(JOIN board_link " " board_link)
list(JOIN board_sources " " board_objects)
string(REGEX REPLACE "nm$" "" compiler_prefix "${CMAKE_NM}")
add_test(NAME target/add_these_files
  COMMAND bash "${structure}/add_these_files_test.sh" "${PROJECT_SOURCE_DIR}" "${FLEXCOMP_EIGEN3_DIR}" "${compiler_prefix}"
    "${FLEXCOMP_CPU_FLAGS}" ${FLEXCOMP_SCALAR}
    "-std=c++17 -fno-exceptions -fno-rtti -fno-tree-loop-distribute-patterns -I${boards}/common ${board_objects} ${board_link} ${link}"
    -- ${CMAKE_CROSSCOMPILING_EMULATOR})
set_tests_properties(target/installed_package target/add_these_files PROPERTIES TIMEOUT 240 LABELS target)
