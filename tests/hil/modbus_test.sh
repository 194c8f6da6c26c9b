#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Host and controller on Modbus TCP and RTU, on this machine's own kernel (tests/hil/buses.py).
set -eu
here=$(dirname "$0")
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
/usr/bin/python3 "$here/buses.py" prepare "$work"
/usr/bin/python3 "$here/buses.py" run "$work" modbus-tcp modbus-rtu
