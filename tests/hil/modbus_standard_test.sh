#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The Modbus server of flexcomp-controller against the serial and TCP guides (tests/hil/modbus_standard.py).
set -eu
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
/usr/bin/python3 "$(dirname "$0")/modbus_standard.py" "$work"
