#!/usr/bin/env bash
# The closed loop: a true robot with hidden errors is measured with noise, identified, the result pushed over the
# emulated line into the emulated firmware, whose commands move the true robot.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
. "$here/host_programs.sh"
PATH=$FLEXCOMP_BIN_DIR:$PATH
robot=$FLEXCOMP_SOURCE_DIR/host/robots/tx60l.yaml
truth=$FLEXCOMP_SOURCE_DIR/tests/data/tx60l_table1.yaml

if [ "${1:-}" = --inside ]; then
  flexcomp push --to "$FLEXCOMP_BUS" calibration.yaml --robot "$robot"
  flexcomp status --of "$FLEXCOMP_BUS"
  flexcomp probe --at "$FLEXCOMP_BUS" --targets targets.csv -o commands.csv
  /usr/bin/python3 "$here/stand_still.py" stood.csv stood_commands.csv
  exit 0
fi

work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
cd "$work"
flexcomp-plant measure --robot "$robot" --truth "$truth" --poses 40 --seed 2019 --measure reflectors --noise N1 \
  -o measured.csv
flexcomp identify --robot "$robot" --data measured.csv -o calibration.yaml --quiet
# Targets that were not measured; where the arm goes uncorrected.
flexcomp-plant measure --robot "$robot" --truth "$truth" --poses 30 --seed 57 --measure position --noise none \
  -o validation.csv
cut -d, -f1-6 validation.csv >targets.csv
flexcomp-plant where --robot "$robot" --truth "$truth" --joints targets.csv --nominal targets.csv -o before.csv \
  --json before.json

"$FLEXCOMP_SOURCE_DIR"/hil/emulators/cortex-m7-modbus --image "$FLEXCOMP_IMAGE" --seconds 120 \
  bash "$here/cortex_m7_closed_loop_test.sh" --inside

flexcomp-plant where --robot "$robot" --truth "$truth" --joints commands.csv --nominal targets.csv -o after.csv \
  --json after.json
flexcomp compensate --robot "$robot" --calibration calibration.yaml --targets targets.csv -o host.csv --quiet
cmp commands.csv host.csv
echo "PASS the firmware's commands are the host's, character for character"

# What the control cycle itself gives to the drives, at poses of its own path.
flexcomp compensate --robot "$robot" --calibration calibration.yaml --targets stood.csv -o stood_host.csv --quiet
paste -d, stood_commands.csv stood_host.csv | awk -F, '
  NR > 1 { for (k = 1; k <= 6; k++) { d = $k - $(k + 6); if (d < 0) d = -d; if (d > worst) worst = d }; n++ }
  END { printf "the cycle'"'"'s commands differ from the host'"'"'s by %.1e deg at most, in %d poses\n", worst, n
    exit !(n > 0 && worst < 3e-7) }' || { echo "FAILED more than the rounding to nrad"; exit 1; }
echo "PASS the control cycle gives the same commands"
for which in stood stood_commands; do
  flexcomp-plant where --robot "$robot" --truth "$truth" --joints $which.csv --nominal stood.csv -o where.csv \
    --json $which.json
done

mean() { sed -n 's/.*"mean_mm": *\([-+0-9.eE]*\).*/\1/p' "$1"; }
# What one measured point is off by: three times the variance of an axis.
noise=$(awk '/^noise:/ { match($0, /position_mm: *[0-9.]+/); s = substr($0, RSTART, RLENGTH); sub(/.*: */, "", s)
  print sqrt(3) * s }' "$robot")
# closed WHERE BEFORE.json AFTER.json
closed() {
  local before after
  before=$(mean "$2")
  after=$(mean "$3")
  echo "mean position error of the true robot at $1: before $before mm, after $after mm; a measured point $noise mm"
  awk -v before="$before" -v after="$after" -v noise="$noise" \
    'BEGIN { exit !(before > 0 && after > 0 && noise > 0 && after < noise && after < before / 10) }' ||
    { echo "FAILED: the error is not below that of a measured point and a tenth of what it was"; exit 1; }
}
closed "30 targets, commands of the probe" before.json after.json
closed "poses of the path, commands of the control cycle" stood.json stood_commands.json
echo "PASS the closed loop"
