#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The control cycle of the emulated Cortex-M7, undisturbed by whatever its bus does (cortex_m7_cycle.py).
. "${BASH_SOURCE[0]%/*}/common.sh"
shift_count=${1:-4}
for kind in identified many-effects; do
  "$hil/emulators/cortex-m7-modbus" --image "$FLEXCOMP_IMAGE" --seconds 280 --shift "$shift_count" \
    /usr/bin/python3 "$here/cortex_m7_cycle.py" "$work" "$shift_count" "$kind"
done
