#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Floods on the CAN bus of the emulated Cortex-R5F (emulated_floods.py): the short form, or with the options that are given.
. "${BASH_SOURCE[0]%/*}/common.sh"
[ $# -gt 0 ] || set -- 'frames of other nodes' 'SDO transfers begun' --seconds 1
log=$(mktemp)
trap 'rm -f -- "$log"' EXIT
# QEMU's model of the CAN controller now and then ends in a flood by an assertion of its own: that says nothing of the firmware.
for attempt in 1 2; do
  if "$hil/with-vcan" --seconds 400 "$hil/emulators/cortex-r5f-canopen" --image "$FLEXCOMP_IMAGE" \
    /usr/bin/python3 -B "$here/emulated_floods.py" r5f "$@" >"$log" 2>&1; then cat "$log"; exit 0; fi
  cat "$log"
  grep -q 'fifo8_push: Assertion' "$log" || exit 1
done
echo "QEMU ended by its own assertion, twice: not judged"
exit 77
