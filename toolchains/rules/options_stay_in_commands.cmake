# SPDX-License-Identifier: Apache-2.0
# cmake -D ROOT=<source folder> -P options_stay_in_commands.cmake
# Library code of the host names no option and no command in a text: errors carry a code (host/error_code.hpp), and
# host/commands/ adds the options that it concerns.
cmake_minimum_required(VERSION 3.25)

string(CONCAT command "flexcomp (simulate|plan|identify|validate|diagnose|predict|compensate|push|pull|status|rollback|"
  "probe|report|export|study|import|completion|keygen|trust|erase)")
set(found 0)
set(files_seen 0)
file(GLOB_RECURSE files RELATIVE "${ROOT}" "${ROOT}/host/*.hpp" "${ROOT}/host/*.cpp")
foreach(file IN LISTS files)
  # The catalogue holds the text of docs/effects.md, which says what commands do.
  if(file MATCHES "^host/(commands/|main\\.cpp$|model/effects/catalogue\\.cpp$)")
    continue()
  endif()
  math(EXPR files_seen "${files_seen} + 1")
  file(STRINGS "${ROOT}/${file}" lines REGEX "\"[^\"]*(--[a-z]|${command})")
  foreach(line IN LISTS lines)
    # Variables of style sheets begin with two dashes too.
    string(REGEX REPLACE "var\\(--" "" line "${line}")
    if(line MATCHES "\"[^\"]*(--[a-z][a-z-]*|${command})")
      message(STATUS "${file}: names ${CMAKE_MATCH_1}, which is commands/' to say")
      math(EXPR found "${found} + 1")
    endif()
  endforeach()
endforeach()
if(found)
  message(FATAL_ERROR "options stay in commands: ${found} texts are against the rule (see above)")
endif()
if(files_seen EQUAL 0)
  message(FATAL_ERROR "options stay in commands: no source file below ${ROOT}")
endif()
