#!/usr/bin/env bash
# hil/emulators/cortex-r5f-canopen: exit statuses come through, what cannot work is said, nothing is left running.
. "${BASH_SOURCE[0]%/*}/common.sh"
set +e
emulator=$FLEXCOMP_SOURCE_DIR/hil/emulators/cortex-r5f-canopen
failed=0
expect() { # expect TEXT STATUS WORDS COMMAND...
  local text=$1 status=$2 words=$3 got
  shift 3
  "$@" >"$work/said" 2>&1
  got=$?
  if [ "$got" -eq "$status" ] && grep -q -e "$words" "$work/said"; then
    echo "ok: $text"
  else
    echo "FAILED: $text: status $got instead of $status, or not '$words':"
    cat "$work/said"
    failed=1
  fi
}
if [ "${1:-}" = inside ]; then
  # A program that ends by itself at once, without having spoken.
  expect "an image that ends" 125 'QEMU ended' bash "$emulator" --image "${FLEXCOMP_IMAGE%/*}/target_must_fail.elf" true
  expect "the status of the command" 37 '^ready cortex-r5f can:vcan0:1$' \
    bash "$emulator" --image "$FLEXCOMP_IMAGE" sh -c 'exit 37'
  # Without a command it stays until it is ended.
  bash "$emulator" --image "$FLEXCOMP_IMAGE" --log "$work/qemu.log" >"$work/staying" 2>&1 &
  staying=$!
  for _ in $(seq 600); do
    grep -q '^ready' "$work/staying" && break
    sleep 0.1
  done
  expect "without a command it serves" 0 'no set' "$FLEXCOMP_BIN_DIR/flexcomp" status --of can:vcan0:1
  kill -TERM "$staying"
  wait "$staying"
  [ $? -eq 143 ] || { echo "FAILED: ended from outside: not 143"; failed=1; }
  # Whatever way it ended: no emulator and no listener of ours is left in this small machine.
  if [ "${FLEXCOMP_VCAN_INSIDE:-}" = uml ] && grep -lE 'qemu-system|candump' /proc/[0-9]*/comm; then
    echo "FAILED: something still runs"
    failed=1
  fi
  exit "$failed"
fi
expect "no image" 125 'none.elf is not there' bash "$emulator" --image "$work/none.elf" true
expect "no such interface" 125 'no CAN interface flexnone' bash "$emulator" --image "$FLEXCOMP_IMAGE" --can flexnone true
expect "an unknown option" 2 'cortex-r5f-canopen \[options\]' bash "$emulator" --unknown
bash "$FLEXCOMP_SOURCE_DIR/hil/with-vcan" --seconds 240 bash "${BASH_SOURCE[0]}" inside || failed=1
exit "$failed"
