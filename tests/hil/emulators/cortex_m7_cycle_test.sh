#!/usr/bin/env bash
# The control cycle of the emulated Cortex-M7 controller, undisturbed by whatever its bus does (cycle.py).
set -eu
here=$(dirname "$0")
. "$here/host_programs.sh"
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
"$FLEXCOMP_SOURCE_DIR"/hil/emulators/cortex-m7-modbus --image "$FLEXCOMP_IMAGE" --seconds 270 --shift 4 \
  /usr/bin/python3 "$here/cycle.py" "$work" 4
