#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# An effect that the first calibration lacks is found in measured rows of the true arm, named, and pushed into the same
# running controller; the arm's error at targets that were never fitted then shrinks by what held-out rows promised.
set -euo pipefail
source=${FLEXCOMP_SOURCE_DIR:?} bin=${FLEXCOMP_BIN_DIR:?}
here=$(cd -- "$(dirname -- "$0")" && pwd)
if [ "${1:-}" = inside ]; then
  # One controller for all that hil/closed-loop does with it: inside FOLDER OPTION ADDRESS COMMAND...
  folder=$2 option=$3 address=$4
  shift 4
  "$bin"/flexcomp-controller --robot "$source"/host/robots/tx60l.yaml --store "$folder"/slots "$option" "$address" \
    >"$folder"/controller.log 2>&1 &
  controller=$!
  trap 'kill "$controller"' EXIT
  for _ in $(seq 200); do grep -q '^ready' "$folder"/controller.log && break; sleep 0.05; done
  "$@"
  exit
fi
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
failed=0

free_port() { # sets port
  port=$(/usr/bin/python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
}

# loop NAME EFFECT OF BUS WRAPPER...: OF is what diagnose must name, as the JSON says it
loop() {
  local name=$1 effect=$2 of=$3 folder
  folder=$work/$name
  shift 3
  mkdir -p "$folder"
  if ! "$source"/hil/closed-loop --bin "$bin" --out "$folder" --poses 80 --hidden "$effect" "$@" >"$folder"/log 2>&1; then
    echo "FAILED: $name"; cat "$folder"/log "$folder"/controller.log; failed=1; return
  fi
  tail -n 4 "$folder"/log
  /usr/bin/python3 "$here"/emulators/closed_loop.py "$folder"/closed_loop.json || failed=1
  /usr/bin/python3 "$here"/named_effect.py "$folder"/diagnosis.json "$of" || { cat "$folder"/log; failed=1; }
  # The set that runs now is longer than the first, and both went to one controller.
  grep -q 'set 1 is active' "$folder"/log && grep -q 'set 2 is active' "$folder"/log ||
    { echo "FAILED: not two sets in one controller"; failed=1; }
  grep -q '  - {effect: link_gravity' "$folder"/calibration.yaml && ! cmp -s "$folder"/first.yaml "$folder"/calibration.yaml ||
    { echo "FAILED: the second set is not the first and more"; failed=1; }
}

loop harmonic '{effect: gear_harmonic, joint: 3, order: 2, sin_rad: 3.0e-4, cos_rad: 1.0e-4}' \
  '{"effect": "gear_harmonic", "joint": 3, "order": 2}' can:vcan0:1 \
  "$source"/hil/with-vcan --seconds 120 bash "$here/${0##*/}" inside "$work"/harmonic --can vcan0:1
# A bump over the angle: no sine.
free_port
loop curve '{effect: joint_curve, joint: 2, coefficients_rad: [0, 0, 4.0e-4, -2.0e-4, 0, 3.0e-4, -4.0e-4, 2.0e-4, 0, 0, 0, 0]}' \
  '{"effect": "joint_curve", "joint": 2}' "modbus-tcp:127.0.0.1:$port:1" \
  bash "$here/${0##*/}" inside "$work"/curve --modbus-tcp "127.0.0.1:$port:1"
# What depends on the side from which a joint comes: the controller takes it from the target's context.
free_port
loop backlash '{effect: backlash, joint: 2, half_gap_rad: 2.0e-4}' \
  '{"effect": "backlash", "joint": 2}' "modbus-tcp:127.0.0.1:$port:1" \
  bash "$here/${0##*/}" inside "$work"/backlash --modbus-tcp "127.0.0.1:$port:1"
# What belongs to the measurement is left out of the push, with a word; the rest goes.
free_port
mkdir "$work"/lag
sed 's/^effects:/&\n  - {effect: readout_lag, joint: 1, rad: 1.2e-3}\n  - {effect: base_drift, x_mm_per_h: 0.02}/' \
  "$work"/harmonic/calibration.yaml >"$work"/lag/lag.yaml
# shellcheck disable=SC2016
bash "$here/${0##*/}" inside "$work"/lag --modbus-tcp "127.0.0.1:$port:1" sh -c '
  "$1"/flexcomp push --to "$2" "$3"/lag.yaml --json "$3"/push.json && "$1"/flexcomp pull --from "$2" --robot "$4" -o "$3"/pulled.yaml' \
  sh "$bin" "modbus-tcp:127.0.0.1:$port:1" "$work"/lag "$source"/host/robots/tx60l.yaml >"$work"/lag/log 2>&1 || failed=1
if grep -q 'lag.yaml: left out, for they belong to the measurement: readout_lag\[joint=1\], base_drift' "$work"/lag/log &&
  grep -q '"left_out"' "$work"/lag/push.json && grep -q 'gear_harmonic' "$work"/lag/pulled.yaml &&
  ! grep -q 'readout_lag\|base_drift' "$work"/lag/pulled.yaml; then
  echo "ok: what belongs to the measurement is not pushed, the rest is"
else
  echo "FAILED: what belongs to the measurement:"; cat "$work"/lag/log; failed=1
fi
exit "$failed"
