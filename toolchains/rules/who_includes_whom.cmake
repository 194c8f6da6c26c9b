# SPDX-License-Identifier: Apache-2.0
# cmake -D ROOT=<source folder> -P who_includes_whom.cmake
# Which part of the repository may include which:
#   include    nothing else
#   firmware   include
#   host       include, never firmware: they meet on the wire, whose layout is in include
#   hil, tests all
# and within host which module may include which (docs/architecture.md).
# Every #include that names a file of ours is resolved the way the compiler would (beside the file itself, then
# the include roots) and must lead where the including part and module may go. What runs on a controller also
# keeps to standard headers that neither allocate, throw nor do I/O.
cmake_minimum_required(VERSION 3.25)

set(parts include firmware host hil tests)
set(include_may include)
set(firmware_may firmware include)
set(host_may host include)
set(hil_may ${parts})
set(tests_may ${parts})
# The modules of host besides its own files without a module (units, errors, quaternions), which all of them may include and
# which include no module. A file may stand beside the modules, for itself alone.
set(modules model linalg measurement kinematics files identification planning diagnosis signing bus exchange report studies commands)
set(model_may)
set(linalg_may)
set(measurement_may model linalg kinematics)
set(kinematics_may model linalg)
set(files_may model measurement)
set(identification_may model measurement linalg)
set(planning_may model measurement linalg identification files)
# data_file.hpp for the names of columns in a message.
set(diagnosis_may model measurement linalg identification host/files/data_file.hpp)
set(signing_may model files)
set(bus_may model files)
set(exchange_may model measurement linalg kinematics files)
set(report_may model measurement linalg files identification planning diagnosis)
set(studies_may model measurement linalg kinematics files identification planning report)
set(commands_may ${modules})
# The program is one of the commands' files.
set(module_of_host/main.cpp commands)
# Names of values of the model and of measured data.
set(module_of_host/named_values.hpp measurement)
set(include_roots include firmware/include firmware/src firmware/boards/common host hil/controller hil tests .)

# The module of a file of host, empty for one without.
function(find_module file out)
  string(REGEX MATCH "^host/([^/]+)/" module "${file}")
  set(module "${CMAKE_MATCH_1}")
  if(DEFINED "module_of_${file}")
    set(module "${module_of_${file}}")
  endif()
  set(${out} "${module}" PARENT_SCOPE)
endfunction()

# Standard headers with a heap, exceptions, threads or I/O behind them.
string(CONCAT refused_in_target "^(iostream|ostream|istream|fstream|sstream|iomanip|ios|cstdio|stdio\\.h|print|"
  "string|vector|map|set|unordered_map|unordered_set|deque|list|forward_list|queue|stack|memory|memory_resource|"
  "functional|any|regex|locale|exception|stdexcept|typeinfo|typeindex|thread|mutex|shared_mutex|"
  "condition_variable|future|filesystem|random|chrono|iomanip|format)$")

set(found 0)
set(files_seen 0)
foreach(part IN LISTS parts)
  file(GLOB_RECURSE files RELATIVE "${ROOT}" "${ROOT}/${part}/*.hpp" "${ROOT}/${part}/*.h" "${ROOT}/${part}/*.cpp"
    "${ROOT}/${part}/*.c")
  foreach(file IN LISTS files)
    # The samples that show what this check refuses are repositories of their own, each with its own test and ROOT.
    if(file MATCHES "/samples/")
      continue()
    endif()
    math(EXPR files_seen "${files_seen} + 1")
    find_module("${file}" module)
    if(part STREQUAL "host" AND module AND NOT module IN_LIST modules)
      message(STATUS "${file}: host/${module} is not in the table of modules")
      math(EXPR found "${found} + 1")
    endif()
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
        string(REGEX REPLACE "/.*$" "" target_part "${target}")
        if(target_part IN_LIST parts AND NOT target_part IN_LIST ${part}_may)
          message(STATUS "${file}: includes ${target}, but ${part} may not include ${target_part}")
          math(EXPR found "${found} + 1")
        endif()
        find_module("${target}" target_module)
        if(part STREQUAL "host" AND target_module AND NOT target_module STREQUAL module
            AND NOT target_module IN_LIST ${module}_may AND NOT target IN_LIST ${module}_may)
          message(STATUS "${file}: includes ${target}, but host/${module} may not include host/${target_module}")
          math(EXPR found "${found} + 1")
        endif()
      elseif(part STREQUAL "include" OR file MATCHES "^firmware/(src|include)/")
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
