#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Measured, identified, pushed into the emulated Cortex-R5F over CAN; its commands move the true arm.
. "${BASH_SOURCE[0]%/*}/common.sh"
closed_loop can:vcan0:1 \
  "$hil/with-vcan" --seconds 240 "$hil/emulators/cortex-r5f-canopen" --image "$FLEXCOMP_IMAGE"
