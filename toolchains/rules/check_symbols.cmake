# SPDX-License-Identifier: Apache-2.0
# cmake -D NM=nm -D IMAGE=elf-or-archive [-D NO_DOUBLE=ON] -P check_symbols.cmake
# What may not be in an image of ours: exceptions, unwinding, run-time type information; and where the
# floating-point unit knows only float, double arithmetic in software.
execute_process(COMMAND "${NM}" "${IMAGE}" OUTPUT_VARIABLE symbols RESULT_VARIABLE result)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "${NM} cannot read ${IMAGE}")
endif()
string(REPLACE "\n" ";" lines "${symbols}")
set(found "")
foreach(line IN LISTS lines)
  if(NOT line MATCHES "([^ ]+)$")
    continue()
  endif()
  set(name "${CMAKE_MATCH_1}")
  if(name MATCHES "^(__cxa_(throw|rethrow|allocate_exception|free_exception|begin_catch|end_catch|get_globals|guard_acquire)|_Unwind_.*|__gxx_personality_.*|__aeabi_unwind_.*|__dynamic_cast|_ZSt9terminatev|_ZSt1[0-9]__throw_.*|_ZSt2[0-9]__throw_.*)$"
     OR name MATCHES "^_ZT[IS]")
    list(APPEND found "exceptions or run-time type information: ${name}")
  elseif(NO_DOUBLE AND name MATCHES "^(__aeabi_d.*|__aeabi_c?dcmp.*|__aeabi_cd.*|__aeabi_.*2d|__(add|sub|mul|div|neg)df3|__extend.*df2|__float.*df|__fix.*df.*|__trunc.*df.*)$")
    list(APPEND found "double arithmetic in software: ${name}")
  endif()
endforeach()
if(found)
  list(REMOVE_DUPLICATES found)
  list(JOIN found "\n  " text)
  message(FATAL_ERROR "flexcomp: ${IMAGE} holds what a controller may not have:\n  ${text}")
endif()
