# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash disable=SC2034
# What the tests of emulated controllers share; sourced. Leaves with ctest's "skipped" where a host program is missing.
set -eu
: "${FLEXCOMP_SOURCE_DIR:?}" "${FLEXCOMP_IMAGE:?}" "${FLEXCOMP_BIN_DIR:?}"
here=${BASH_SOURCE[0]%/*}
hil=$FLEXCOMP_SOURCE_DIR/hil
for program in flexcomp flexcomp-plant; do
  if ! [ -x "$FLEXCOMP_BIN_DIR/$program" ]; then
    echo "SKIPPED: $FLEXCOMP_BIN_DIR/$program is not there. First: cmake --preset host && cmake --build --preset host"
    echo "(or set FLEXCOMP_HOST_BIN_DIR to the folder where the programs are)"
    exit 77
  fi
done
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT

# --- of hil/emulators/* themselves ------------------------------------------------------------------------------------

failed=0
failure() {
  echo "FAILED: $*"
  failed=1
}

# expect TEXT STATUS WORDS COMMAND...: ends with STATUS and has said WORDS
expect() {
  local text=$1 status=$2 words=$3 got=0
  shift 3
  "$@" >"$work/said" 2>&1 || got=$?
  if [ "$got" -eq "$status" ] && grep -q -e "$words" "$work/said"; then
    echo "ok: $text"
  else
    failure "$text: status $got instead of $status, or not '$words':"
    cat "$work/said"
  fi
}

# expect_of_any EMULATOR: what needs no controller
expect_of_any() {
  expect "no image" 125 'none.elf is not there' "$1" --image "$work/none.elf" true
  expect "an unknown option" 2 "${1##*/} \[options\]" "$1" --unknown
  expect "a time that is none" 125 "not 'soon'" "$1" --image "$FLEXCOMP_IMAGE" --seconds soon true
  expect "--help" 0 "${1##*/} \[options\]" "$1" --help
}

# expect_statuses EMULATOR: what COMMAND's end makes of the emulator's
expect_statuses() {
  # A program that ends by itself at once, without having served anybody.
  expect "an image that ends" 125 'QEMU ended' "$1" --image "${FLEXCOMP_IMAGE%/*}/target_must_fail.elf" sleep 60
  # shellcheck disable=SC2016
  expect "the status of the command, which finds the address" 37 '^modbus-rtu:\|^can:' \
    "$1" --image "$FLEXCOMP_IMAGE" sh -c 'echo "$FLEXCOMP_BUS"; exit 37'
  expect "a command that does not end" 124 begun "$1" --image "$FLEXCOMP_IMAGE" --seconds 1 sh -c 'echo begun; sleep 60'
}

# expect_serves WORDS OF EMULATOR...: the way a person starts it, without a command: it says the address and serves
# there until it is ended. `flexcomp status` says WORDS; OF stands at the beginning of the address.
expect_serves() {
  local words=$1 of=$2 staying status=0
  shift 2
  "$@" --log "$work/log" >"$work/ready" 2>&1 &
  staying=$!
  for _ in $(seq 1200); do
    if grep -q '^ready' "$work/ready" || ! kill -0 "$staying" 2>/dev/null; then break; fi
    sleep 0.1
  done
  expect "it says where it serves" 0 "^ready $of" cat "$work/ready"
  expect "and serves" 0 "$words" "$FLEXCOMP_BIN_DIR/flexcomp" status --of "$(awk '/^ready/ { print $2 }' "$work/ready")"
  kill -TERM "$staying"
  wait "$staying" || status=$?
  [ "$status" -eq 143 ] || failure "ended from outside: $status instead of 143"
}

# --- the closed loop --------------------------------------------------------------------------------------------------

# What the first calibration cannot know: diagnose finds it, and the controller gets a longer set.
hidden='{effect: gear_harmonic, joint: 3, order: 2, sin_rad: 3.0e-4, cos_rad: 1.0e-4}'

# closed_loop BUS WRAPPER...: hil/closed-loop, its result judged; its files are left in $work
closed_loop() {
  "$hil/closed-loop" --bin "$FLEXCOMP_BIN_DIR" --out "$work" --poses 80 --hidden "$hidden" "$@"
  /usr/bin/python3 "$here/closed_loop.py" "$work/closed_loop.json"
  compensate "$work/targets.csv" "$work/expected.csv"
  cmp "$work/commands.csv" "$work/expected.csv"
  echo "ok: the controller's commands are compensate's, character for character"
}

# compensate TARGETS COMMANDS: the host's commands with the set that the controller has
compensate() {
  "$FLEXCOMP_BIN_DIR/flexcomp" compensate --robot "$FLEXCOMP_SOURCE_DIR/host/robots/tx60l.yaml" --quiet \
    --calibration "$work/calibration.yaml" --targets "$1" -o "$2"
}
