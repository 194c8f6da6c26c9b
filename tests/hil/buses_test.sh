#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Host and controller on all three buses at once: CAN on vcan0, Modbus TCP, Modbus RTU (tests/hil/buses.py).
set -eu
here=$(dirname "$0")
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
# What needs no bus is done outside: inside user-mode Linux a new process is expensive.
/usr/bin/python3 "$here/buses.py" prepare "$work"
bash "$here/../../hil/with-vcan" --seconds 200 /usr/bin/python3 "$here/buses.py" run "$work" can modbus-tcp modbus-rtu
