# SPDX-License-Identifier: Apache-2.0
# cmake -D ROOT=<source folder> -P who_includes_whom.cmake
# The rooms of the house and who may know whom:
#   include    knows nobody
#   firmware   knows include
#   host       knows include, never firmware: they meet on the wire, whose layout is in include
#   hil, tests know all
# Every #include that names a file of ours is resolved the way the compiler would (beside the file itself, then
# the include roots) and must lead into a room that the including room may know. What runs on a controller also
# keeps to standard headers that neither allocate, throw nor do I/O.
cmake_minimum_required(VERSION 3.25)

set(rooms include firmware host hil tests)
set(include_may include)
set(firmware_may firmware include)
set(host_may host include)
set(hil_may ${rooms})
set(tests_may ${rooms})
set(include_roots include firmware/include firmware/src firmware/boards/common host hil/controller hil tests .)

# Standard headers with a heap, exceptions, threads or I/O behind them.
string(CONCAT refused_in_target "^(iostream|ostream|istream|fstream|sstream|iomanip|ios|cstdio|stdio\\.h|print|"
  "string|vector|map|set|unordered_map|unordered_set|deque|list|forward_list|queue|stack|memory|memory_resource|"
  "functional|any|regex|locale|exception|stdexcept|typeinfo|typeindex|thread|mutex|shared_mutex|"
  "condition_variable|future|filesystem|random|chrono|iomanip|format)$")

set(found 0)
set(files_seen 0)
foreach(room IN LISTS rooms)
  file(GLOB_RECURSE files RELATIVE "${ROOT}" "${ROOT}/${room}/*.hpp" "${ROOT}/${room}/*.h" "${ROOT}/${room}/*.cpp"
    "${ROOT}/${room}/*.c")
  foreach(file IN LISTS files)
    # The samples that show what this check refuses are themselves a little house; they are looked at by their
    # own test with their own ROOT.
    if(file MATCHES "/samples/")
      continue()
    endif()
    math(EXPR files_seen "${files_seen} + 1")
    get_filename_component(own_folder "${file}" DIRECTORY)
    file(STRINGS "${ROOT}/${file}" lines REGEX "^[ \t]*#[ \t]*include[ \t]*[<\"]")
    foreach(line IN LISTS lines)
      string(REGEX REPLACE "^[ \t]*#[ \t]*include[ \t]*([<\"])([^>\"]*)[>\"].*$" "\\2" name "${line}")
      set(roots ${include_roots})
      if(line MATCHES "include[ \t]*\"")
        list(PREPEND roots "${own_folder}")
      endif()
      set(target "")
      foreach(root IN LISTS roots)
        if(EXISTS "${ROOT}/${root}/${name}" AND NOT IS_DIRECTORY "${ROOT}/${root}/${name}")
          get_filename_component(target "${ROOT}/${root}/${name}" ABSOLUTE)
          file(RELATIVE_PATH target "${ROOT}" "${target}")
          break()
        endif()
      endforeach()
      if(target)
        string(REGEX REPLACE "/.*$" "" target_room "${target}")
        if(target_room IN_LIST rooms AND NOT target_room IN_LIST ${room}_may)
          message(STATUS "${file}: includes ${target}, but ${room} may not know ${target_room}")
          math(EXPR found "${found} + 1")
        endif()
      elseif(room STREQUAL "include" OR file MATCHES "^firmware/(src|include)/")
        if(name MATCHES "${refused_in_target}")
          message(STATUS "${file}: includes <${name}>, which has a heap, exceptions, threads or I/O behind it")
          math(EXPR found "${found} + 1")
        endif()
      endif()
    endforeach()
  endforeach()
endforeach()
if(found)
  message(FATAL_ERROR "who includes whom: ${found} includes are against the rules (see above)")
endif()
if(files_seen EQUAL 0)
  message(FATAL_ERROR "who includes whom: no source file below ${ROOT}")
endif()
