#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The emulated Cortex-R5F as a CANopen node on vcan0: our own client, can-utils, python-can and tshark
# (cortex_r5f_canopen.py).
here=${BASH_SOURCE[0]%/*}
if [ "${1:-}" = inside ]; then
  # Where vcan0 is, all frames are recorded from before the emulator starts until it has ended.
  work=$2
  candump -L -r 8388608 vcan0 >"$work/frames.log" &
  candump=$!
  "$FLEXCOMP_SOURCE_DIR"/hil/emulators/cortex-r5f-canopen --image "$FLEXCOMP_IMAGE" \
    /usr/bin/python3 "$here/cortex_r5f_canopen.py" run "$work"
  status=$?
  kill -INT "$candump"
  wait "$candump"
  exit "$status"
fi
. "$here/common.sh"
# What needs no bus is done outside: inside user-mode Linux a new process is expensive.
/usr/bin/python3 "$here/cortex_r5f_canopen.py" prepare "$work"
"$hil/with-vcan" --seconds 240 bash "${BASH_SOURCE[0]}" inside "$work"
/usr/bin/python3 "$here/cortex_r5f_canopen.py" frames "$work"
