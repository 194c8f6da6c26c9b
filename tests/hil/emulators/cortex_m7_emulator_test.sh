#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# hil/emulators/cortex-m7-modbus: exit statuses come through, what cannot work is said, nothing is left behind.
. "${BASH_SOURCE[0]%/*}/common.sh"
emulator=$hil/emulators/cortex-m7-modbus
expect_of_any "$emulator"
touch "$work/there"
expect "a device that is there" 125 'there is there already' "$emulator" --image "$FLEXCOMP_IMAGE" --device "$work/there" true
expect_statuses "$emulator"
expect_serves staubli-tx60l "modbus-rtu:$work/line:115200:N:1 console=" \
  "$emulator" --image "$FLEXCOMP_IMAGE" --device "$work/line"
left=$(grep -ls -- "$work/[l]ine" /proc/[0-9]*/cmdline || true)
if [ -n "$left" ] || [ -L "$work/line" ] || [ -e "$(sed 's/.*console=//' "$work/ready")" ]; then
  failure "something is left of the emulator: $left"
fi
exit "$failed"
