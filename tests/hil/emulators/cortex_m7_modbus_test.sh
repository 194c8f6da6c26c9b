#!/usr/bin/env bash
# The emulated Cortex-M7 controller on Modbus RTU: our own client, mbpoll and pymodbus (modbus_rtu.py).
set -eu
here=$(dirname "$0")
. "$here/host_programs.sh"
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
/usr/bin/python3 "$here/../buses.py" prepare "$work"
"$FLEXCOMP_SOURCE_DIR"/hil/emulators/cortex-m7-modbus --image "$FLEXCOMP_IMAGE" --seconds 200 \
  /usr/bin/python3 "$here/modbus_rtu.py" "$work"
