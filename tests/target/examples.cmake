# SPDX-License-Identifier: Apache-2.0
# The examples of firmware/examples that need no board of their own: they run on the host and, as images, on every
# target, and end with 0 where they get the host's numbers. C as C90, which is what the oldest controllers have.
set(examples "${PROJECT_SOURCE_DIR}/firmware/examples")

# flexcomp_example(<name> <source> LIBRARIES <...>)
function(flexcomp_example name source)
  cmake_parse_arguments(PARSE_ARGV 2 arg "" "" "LIBRARIES")
  add_executable(example_${name} "${examples}/${source}")
  target_include_directories(example_${name} PRIVATE "${examples}" "${PROJECT_SOURCE_DIR}/firmware/include")
  target_link_libraries(example_${name} PRIVATE ${arg_LIBRARIES} flexcomp_target_warnings)
  if(source MATCHES "\\.c$")
    set_target_properties(example_${name} PROPERTIES C_STANDARD 90 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF
      LINKER_LANGUAGE CXX)
  endif()
  if(CMAKE_CROSSCOMPILING)
    target_compile_definitions(example_${name} PRIVATE FLEXCOMP_SCALAR=${FLEXCOMP_SCALAR})
    flexcomp_link_image(example_${name})
  else()
    set_target_properties(example_${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/bin/tests")
  endif()
  add_test(NAME target/example_${name} COMMAND example_${name})
  set_tests_properties(target/example_${name} PROPERTIES TIMEOUT 60 LABELS target)
endfunction()

flexcomp_example(minimal_controller minimal_controller.c LIBRARIES flexcomp_firmware)
flexcomp_example(two_arms two_arms.c LIBRARIES flexcomp_firmware)
flexcomp_example(servo_loop servo_loop.c LIBRARIES flexcomp_firmware)
flexcomp_example(core_only core_only.cpp LIBRARIES flexcomp_core)
# Its function that checks a signature is OpenSSL's, which no target here has.
if(NOT CMAKE_CROSSCOMPILING)
  find_package(OpenSSL REQUIRED COMPONENTS Crypto)
  flexcomp_example(signed_sets signed_sets.c LIBRARIES flexcomp_firmware OpenSSL::Crypto)
endif()
