#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The file store of flexcomp-controller under SIGKILL (tests/hil/store_kills.py).
/usr/bin/python3 -B "$(dirname "$0")/store_kills.py" "${1:-40}"
