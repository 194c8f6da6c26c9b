#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# ./demo with the programs that were just built: the whole way, and what it leaves behind. Nothing is installed or built.
set -euo pipefail
source=${FLEXCOMP_SOURCE_DIR:?} bin=${FLEXCOMP_BIN_DIR:?}
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
# From another folder, into one with a blank in its name; measured data have a test of their own.
cd -- "$work"
FLEXCOMP_DATA=$work/none "$source"/demo --no-build --bin "$bin" --out 'the demo' >log 2>&1 || { cat log; exit 1; }
/usr/bin/python3 "$source"/tests/hil/demo_summary.py 'the demo/summary.json' log

# README shows these numbers.
grep -E '^(before|after):' "$source"/README.md >shown
grep -E '^(before|after):' log | diff - shown || { echo "FAILED: README.md shows other numbers (>) than ./demo (<)"; exit 1; }

# Without programs it says so.
if "$source"/demo --no-build --bin "$work" --out x >log 2>&1; then echo "FAILED: ran without programs"; exit 1; fi
grep -q 'flexcomp is not there' log || { cat log; exit 1; }
