#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The CANopen node of flexcomp-controller against CiA 301 and its data sheet against CiA 306 (tests/hil/canopen_standard.py).
set -eu
here=$(dirname "$0")
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
/usr/bin/python3 -B "$here/canopen_standard.py" prepare "$work"
bash "$here/../../hil/with-vcan" --seconds 300 /usr/bin/python3 -B "$here/canopen_standard.py" run "$work" "$@"
