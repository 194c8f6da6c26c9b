#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Floods on the buses of flexcomp-controller (tests/hil/floods.py), the short form.
set -eu
here=$(dirname "$0")
/usr/bin/python3 -B "$here/floods.py" --seconds 1 'connections from another address' 'requests whose answers nobody reads' \
  'noise, a full line' 'noise, ten bursts/s'
bash "$here/../../hil/with-vcan" --seconds 150 /usr/bin/python3 -B "$here/floods.py" --seconds 1 'frames of other nodes' 'SDO transfers begun'
