#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The emulated Cortex-M7 on Modbus RTU: our own client, mbpoll and pymodbus (cortex_m7_modbus.py).
. "${BASH_SOURCE[0]%/*}/common.sh"
/usr/bin/python3 "$here/../buses.py" prepare "$work"
"$hil/emulators/cortex-m7-modbus" --image "$FLEXCOMP_IMAGE" --seconds 570 \
  /usr/bin/python3 "$here/cortex_m7_modbus.py" "$work"
