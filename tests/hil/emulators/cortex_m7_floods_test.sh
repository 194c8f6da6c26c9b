#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Noise and requests without end on the line of the emulated Cortex-M7 (emulated_floods.py).
. "${BASH_SOURCE[0]%/*}/common.sh"
"$hil/emulators/cortex-m7-modbus" --image "$FLEXCOMP_IMAGE" --seconds 280 \
  /usr/bin/python3 -B "$here/emulated_floods.py" m7 "$@"
