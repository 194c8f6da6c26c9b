#!/usr/bin/env bash
# find_package(flexcomp) from an installed copy: a project elsewhere configures, builds and runs.
set -euo pipefail
build=$1 consumer=$2
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
cmake --install "$build" --prefix "$work/prefix" >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
cmake -G Ninja -S "$consumer" -B "$work/build" -D CMAKE_PREFIX_PATH="$work/prefix" >"$work/log" 2>&1 &&
  cmake --build "$work/build" >>"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
"$work/build/consumer"
# Only our own headers, and none that names this source folder.
if grep -rlF "$(dirname "$build")" "$work/prefix"/lib*/ "$work/prefix/include" --include='*.cmake' --include='*.h*'; then
  echo "these name the folder in which the package was built"
  exit 1
fi
echo "the installed package is found, built against and run"
