#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# hil/emulators/cortex-r5f-canopen: exit statuses come through, what cannot work is said, nothing is left running.
. "${BASH_SOURCE[0]%/*}/common.sh"
emulator=$hil/emulators/cortex-r5f-canopen
if [ "${1:-}" = inside ]; then
  expect_statuses "$emulator"
  expect_serves 'no set' 'can:vcan0:1$' "$emulator" --image "$FLEXCOMP_IMAGE"
  # Whatever way it ended: no emulator and no listener of ours is left in this small machine.
  if [ "${FLEXCOMP_VCAN_INSIDE:-}" = uml ] && grep -lE 'qemu-system|candump' /proc/[0-9]*/comm; then
    failure "something still runs"
  fi
  exit "$failed"
fi
expect_of_any "$emulator"
expect "no such interface" 125 'no CAN interface flexnone' "$emulator" --image "$FLEXCOMP_IMAGE" --can flexnone true
"$hil/with-vcan" --seconds 240 bash "${BASH_SOURCE[0]}" inside || failed=1
exit "$failed"
