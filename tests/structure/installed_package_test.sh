#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# installed_package_test.sh BUILD CONSUMER [CMAKE OPTION...] [-- EMULATOR...]
# find_package(flexcomp) from an installed copy: a project elsewhere configures, builds and runs, here or, with a
# toolchain file among the options, in an emulator.
set -euo pipefail
build=$1 consumer=$2
shift 2
options=()
while [ $# -gt 0 ] && [ "$1" != -- ]; do options+=("$1"); shift; done
[ $# -eq 0 ] || shift
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
cmake --install "$build" --prefix "$work/prefix" >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
cmake -G Ninja -S "$consumer" -B "$work/build" -D CMAKE_PREFIX_PATH="$work/prefix" \
    -D CMAKE_FIND_ROOT_PATH_MODE_PACKAGE=BOTH "${options[@]}" >"$work/log" 2>&1 &&
  cmake --build "$work/build" >>"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
ran=0
for program in "$work"/build/consumer_core "$work"/build/consumer_firmware "$work"/build/*.elf; do
  [ -e "$program" ] || continue
  "$@" "$program" || { echo "${program##*/} ends with $?"; exit 1; }
  ran=$((ran + 1))
done
[ "$ran" -eq 2 ] || { echo "$ran programs of two were built"; ls "$work/build"; exit 1; }
# Only our own headers, and none that names this source folder.
if grep -rlF "$(dirname "$build")" "$work/prefix"/lib*/ "$work/prefix/include" --include='*.cmake' --include='*.h*'; then
  echo "these name the folder in which the package was built"
  exit 1
fi
echo "the installed package is found, built against and run"
