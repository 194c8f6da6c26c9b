#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Pushes over CAN interfaces of the kernel with losses, doubled frames and another master (tests/hil/disturbed_vcan.py).
set -eu
here=$(dirname "$0")
bash "$here/../../hil/with-vcan" --seconds 200 /usr/bin/python3 -B "$here/disturbed_vcan.py" "${1:-1}"
