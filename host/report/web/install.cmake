# SPDX-License-Identifier: Apache-2.0
# cmake -D NPM=... -D FROM=<folder with package.json and its lock file> -D TO=<folder> -P install.cmake
# Exactly what the lock file names, into TO/node_modules. No package runs a script of its own.
foreach(file package.json package-lock.json)
  configure_file("${FROM}/${file}" "${TO}/${file}" COPYONLY)
endforeach()
execute_process(COMMAND "${NPM}" ci --ignore-scripts --no-audit --no-fund --prefer-offline --loglevel=error
  WORKING_DIRECTORY "${TO}" RESULT_VARIABLE result OUTPUT_VARIABLE said ERROR_VARIABLE said)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "${said}\nnpm could not install what ${FROM}/package-lock.json names (above: what it says). It needs "
    "the npm registry once. Without it: cmake -D FLEXCOMP_REPORT_WEB=OFF builds reports without the 3-D view and the "
    "plots to choose from.")
endif()
file(TOUCH "${TO}/installed")
