#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Measured, identified, pushed into the emulated Cortex-M7 over Modbus RTU; its commands move the true arm: those it
# answers to a probe, and those its control cycle gives to the drives.
here=${BASH_SOURCE[0]%/*}
if [ "${1:-}" = inside ]; then
  # Around what hil/closed-loop does there.
  work=$2
  shift 2
  "$@" && "$FLEXCOMP_BIN_DIR/flexcomp" status --of "$FLEXCOMP_BUS" &&
    /usr/bin/python3 "$here/cortex_m7_stand_still.py" "$work/stood.csv" "$work/stood_commands.csv"
  exit
fi
. "$here/common.sh"
closed_loop "modbus-rtu:$work/line:115200:N:1" \
  "$hil/emulators/cortex-m7-modbus" --image "$FLEXCOMP_IMAGE" --device "$work/line" --seconds 240 \
  bash "${BASH_SOURCE[0]}" inside "$work"

# What the control cycle itself gives to the drives, at poses of its own path.
compensate "$work/stood.csv" "$work/stood_host.csv"
paste -d, "$work/stood_commands.csv" "$work/stood_host.csv" | awk -F, '
  NR > 1 { for (k = 1; k <= 6; k++) { d = $k - $(k + 6); if (d < 0) d = -d; if (d > worst) worst = d }; n++ }
  END { printf "the control cycle'"'"'s commands differ from the host'"'"'s by %.1e deg at most, in %d poses\n", worst, n
    exit !(n > 0 && worst < 3e-7) }' || { echo "FAILED: more than the rounding to nrad"; exit 1; }
echo "ok: the control cycle gives the same commands"
mean() { # mean COMMANDS: of the position error of the true arm, mm
  "$FLEXCOMP_BIN_DIR/flexcomp-plant" where --robot "$FLEXCOMP_SOURCE_DIR/host/robots/tx60l.yaml" \
    --truth "$work/truth.yaml" --joints "$1" --nominal "$work/stood.csv" \
    -o "$work/where.csv" --json "$work/where.json" >/dev/null
  sed -n 's/.*"mean_mm": *\([-+0-9.eE]*\).*/\1/p' "$work/where.json"
}
before=$(mean "$work/stood.csv")
after=$(mean "$work/stood_commands.csv")
noise=$(sed -n 's/.*"noise_mm": *\([0-9.]*\).*/\1/p' "$work/closed_loop.json")
echo "at poses of the path, commands of the control cycle: before $before mm, after $after mm"
awk -v before="$before" -v after="$after" -v noise="$noise" \
  'BEGIN { exit !(before > 0 && after > 0 && noise > 0 && after < sqrt(3) * noise && after < before / 10) }' ||
  { echo "FAILED: not below the error of a measured point and a tenth of what it was"; exit 1; }
echo "ok: the control cycle's commands move the true arm to its targets"
