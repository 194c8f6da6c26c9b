#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Pushes over disturbed buses (tests/hil/disturbed_buses.py), the short form.
set -eu
exec /usr/bin/python3 -B "$(dirname "$0")/disturbed_buses.py"
