#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# qemu-r5f.sh IMAGE: the bare machine takes its image through a loader option, which ctest's way of putting the
# image last on the command line cannot express.
exec qemu-system-arm -M none -cpu cortex-r5f -m 16M -display none -monitor none -serial none -icount shift=0 \
  -semihosting-config enable=on,target=native -device "loader,file=$1,cpu-num=0"
