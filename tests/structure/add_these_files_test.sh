#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# add_these_files_test.sh SOURCE EIGEN PREFIX CPU SCALAR LINK [-- EMULATOR...]
# A build without our CMake, as docs/targets.md tells it: the Makefile that stands there, word for word, then a C program
# with the flags that it names, linked and run. PREFIX is that of the compilers, empty for this machine; LINK holds the
# board's sources and linker options.
set -euo pipefail
source=$1 eigen=$2 prefix=$3 cpu=$4 scalar=$5 link=$6
shift 6
[ $# -eq 0 ] || shift
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
cd "$work"
awk '/^<!-- file Makefile -->/ { wanted = 1; next } wanted && /^```/ { if (inside) exit; inside = 1; next } inside' \
  "$source/docs/targets.md" >Makefile
[ -s Makefile ] || { echo "docs/targets.md has no Makefile"; exit 1; }
make FLEXCOMP="$source" EIGEN="$eigen" PREFIX="$prefix" CPU="$cpu" SCALAR="$scalar" >log 2>&1 || { cat log; exit 1; }
# What the page says that an own source takes, from the Makefile itself.
defines=$(make FLEXCOMP="$source" SCALAR="$scalar" -pn 2>/dev/null | sed -n 's/^DEFINES = //p' | sed "s/\$(SCALAR)/$scalar/")
[ -n "$defines" ] || { echo "no DEFINES"; exit 1; }
if [ -z "$prefix" ]; then
  # A board brings its own; on a host the program does.
  printf '#include <stdlib.h>\nvoid flexcomp_fault(void);\nvoid flexcomp_fault(void) { abort(); }\n' >fault.c
  "${prefix}gcc" $cpu -O2 -c fault.c
fi
"${prefix}gcc" $cpu $defines -I"$source/firmware/include" -std=c90 -pedantic-errors -Wall -Wextra -Werror -O2 \
  -c "$source/firmware/examples/minimal_controller.c"
# shellcheck disable=SC2086 # flags are lists
"${prefix}g++" $cpu minimal_controller.o $(ls fault.o 2>/dev/null) libflexcomp.a $link -o controller.elf
"$@" ./controller.elf || { echo "the controller ends with $?"; exit 1; }
echo "seven files, one Makefile, and the controller corrects its command"
