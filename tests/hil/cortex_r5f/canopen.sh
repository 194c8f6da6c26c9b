#!/usr/bin/env bash
# The firmware in the emulated Cortex-R5F on its emulated CAN controller: our own client, can-utils,
# python-can and tshark (judge.py).
. "${BASH_SOURCE[0]%/*}/common.sh"
# What needs no bus is done outside: inside user-mode Linux a new process is expensive.
/usr/bin/python3 "$here/judge.py" prepare "$work"
bash "$FLEXCOMP_SOURCE_DIR/hil/with-vcan" --seconds 240 bash "$here/inside.sh" "$work"
/usr/bin/python3 "$here/judge.py" frames "$work"
