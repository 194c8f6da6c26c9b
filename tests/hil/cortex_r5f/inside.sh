#!/usr/bin/env bash
# inside.sh WORK: where vcan0 is, all frames are recorded from before the emulator starts until it has ended.
set -u
here=${BASH_SOURCE[0]%/*}
work=$1
candump -L -r 8388608 vcan0 >"$work/frames.log" &
candump=$!
"$here"/../../../hil/emulators/cortex-r5f-canopen --image "$FLEXCOMP_IMAGE" /usr/bin/python3 "$here/judge.py" run "$work"
status=$?
kill -INT "$candump"
wait "$candump"
exit "$status"
