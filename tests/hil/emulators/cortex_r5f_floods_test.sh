#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Floods on the CAN bus of the emulated Cortex-R5F (emulated_floods.py): the short form, or with the options that are given.
. "${BASH_SOURCE[0]%/*}/common.sh"
[ $# -gt 0 ] || set -- 'frames of other nodes' 'SDO transfers begun' 'NMT reset' --seconds 1
"$hil/with-vcan" --seconds 400 "$hil/emulators/cortex-r5f-canopen" --image "$FLEXCOMP_IMAGE" \
  /usr/bin/python3 -B "$here/emulated_floods.py" r5f "$@"
