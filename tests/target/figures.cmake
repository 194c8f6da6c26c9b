# SPDX-License-Identifier: Apache-2.0
# Stack, flash and RAM of the library against docs/figures.json, and samples of what the stack's measure refuses.
find_package(Python3 REQUIRED COMPONENTS Interpreter)
foreach(name nothing core_store both_buses)
  add_executable(target_size_${name} size/${name}.c)
  set_target_properties(target_size_${name} PROPERTIES LINKER_LANGUAGE CXX)
  target_link_libraries(target_size_${name} PRIVATE flexcomp_target_warnings)
  if(NOT name STREQUAL "nothing")
    target_link_libraries(target_size_${name} PRIVATE flexcomp_firmware)
  endif()
  flexcomp_link_image(target_size_${name})
endforeach()
add_library(target_size_memory OBJECT size/memory.c)
target_link_libraries(target_size_memory PRIVATE flexcomp_firmware)

get_filename_component(target "${CMAKE_TOOLCHAIN_FILE}" NAME_WE)
string(REGEX REPLACE "nm$" "" tools "${CMAKE_NM}")
set(figures ${Python3_EXECUTABLE} "${CMAKE_CURRENT_SOURCE_DIR}/figures.py")
set(documented "${PROJECT_SOURCE_DIR}/docs/figures.json")
set(figures_of --figures "${documented}" --target ${target} --build "${CMAKE_BINARY_DIR}"
  --tools "${tools}")
add_test(NAME target/figures COMMAND ${figures} check ${figures_of})
# The comparison itself: a file that promises less than is measured is refused.
set(promise_less "import json, sys
f = json.load(open(sys.argv[1]))
next(r for r in f[sys.argv[2]]['rows'] if r['figure'] == sys.argv[3])['${target}'] = 100
json.dump(f, open(sys.argv[4], 'w'))")
add_test(NAME target/figures_are_compared
  COMMAND sh -c "\"$1\" -c \"$2\" \"$3\" target_bytes 'stack poll' wrong_figures.json && shift 3 && \"$@\"" sh
    ${Python3_EXECUTABLE} "${promise_less}" "${documented}" ${figures} check --figures wrong_figures.json
    --target ${target} --build "${CMAKE_BINARY_DIR}" --tools "${tools}")
set_tests_properties(target/figures_are_compared PROPERTIES TIMEOUT 60 LABELS target
  PASS_REGULAR_EXPRESSION "stack poll +[0-9]+ documented 100 .*ABOVE what is documented")
add_test(NAME target/step_is_compiled_for_speed
  COMMAND ${figures} speed --build "${CMAKE_BINARY_DIR}" --tools "${tools}")
set_tests_properties(target/figures target/step_is_compiled_for_speed PROPERTIES TIMEOUT 60 LABELS target)
add_custom_target(figures COMMAND ${figures} update ${figures_of} VERBATIM
  DEPENDS target_size_nothing target_size_core_store target_size_both_buses target_size_memory target_firmware_links)

# The instruction budget, counted in the emulator: an instruction takes 1024 ns there, so that the board's clock counts
# it to the nearest (the bare Cortex-R5F counts at 1 ns as it is started anyway).
string(REPLACE "shift=2" "shift=10" counting "${CMAKE_CROSSCOMPILING_EMULATOR}")
set(instructions_of --figures "${documented}" --target ${target} -- ${counting}
  $<TARGET_FILE:budget_parts>)
add_test(NAME target/instructions COMMAND ${figures} instructions check ${instructions_of})
add_test(NAME target/instructions_are_compared
  COMMAND sh -c "\"$1\" -c \"$2\" \"$3\" target_instructions \"$4\" wrong_instructions.json && shift 4 && \"$@\"" sh
    ${Python3_EXECUTABLE} "${promise_less}" "${documented}" "SDO request (expedited upload)" ${figures} instructions
    check --figures wrong_instructions.json --target ${target} -- ${counting} $<TARGET_FILE:budget_parts>)
set_tests_properties(target/instructions target/instructions_are_compared PROPERTIES TIMEOUT 60 LABELS target)
set_tests_properties(target/instructions_are_compared PROPERTIES
  PASS_REGULAR_EXPRESSION "SDO request .* documented 100 .*ABOVE what is documented")
add_test(NAME target/budget COMMAND ${counting} $<TARGET_FILE:budget>)
set_tests_properties(target/budget PROPERTIES TIMEOUT 60 LABELS target)
add_test(NAME target/step_cost COMMAND ${counting} $<TARGET_FILE:target_step_cost>)
add_test(NAME target/check_slices COMMAND ${counting} $<TARGET_FILE:target_check_slices>)
set_tests_properties(target/step_cost target/check_slices PROPERTIES TIMEOUT 60 LABELS target)
add_custom_target(instructions COMMAND ${figures} instructions update ${instructions_of} VERBATIM)

# The call graph's answer against a run.
add_executable(target_stack stack_selftest.cpp)
target_include_directories(target_stack PRIVATE "${PROJECT_SOURCE_DIR}/firmware")
target_link_libraries(target_stack PRIVATE flexcomp_firmware flexcomp_target_warnings)
flexcomp_link_image(target_stack)
add_test(NAME target/stack_in_a_run COMMAND ${figures} run --build "${CMAKE_BINARY_DIR}" --tools "${tools}" --
  ${CMAKE_CROSSCOMPILING_EMULATOR} $<TARGET_FILE:target_stack>)
set_tests_properties(target/stack_in_a_run PROPERTIES TIMEOUT 60 LABELS target)

set(why_big_frame "more than the 2560 bytes allowed")
set(why_recursion "refused: recursion: sample -> .*other.* -> sample")
set(why_pointer "refused: sample: calls through a pointer")
set(why_dynamic "refused: sample: the size of its frame is known only at run time")
foreach(sample big_frame recursion pointer dynamic)
  add_library(target_sample_stack_${sample} OBJECT samples/stack/${sample}.cpp)
  target_compile_options(target_sample_stack_${sample} PRIVATE -fcallgraph-info=su)
  set_target_properties(target_sample_stack_${sample} PROPERTIES CXX_COMPILER_LAUNCHER "")
  add_test(NAME target/refused_stack_${sample}
    COMMAND ${figures} stack --entry sample --limit 2560
      --ci "${CMAKE_CURRENT_BINARY_DIR}/CMakeFiles/target_sample_stack_${sample}.dir/samples/stack/${sample}.cpp.ci")
  set_tests_properties(target/refused_stack_${sample} PROPERTIES TIMEOUT 30 LABELS target
    PASS_REGULAR_EXPRESSION "${why_${sample}}")
endforeach()
