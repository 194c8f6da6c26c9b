#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The command line as a user meets it: exit status, messages, files; simulate, predict, compensate.
set -u
source "${FLEXCOMP_SOURCE_DIR:?}/tests/host/commands/common.sh"

expect 0 "Exit status" --help
expect 0 "Example" simulate --help
expect 0 "flexcomp 0." --version
expect 2 "subcommand is required"
expect 2 "--robot is required" predict --joints q.csv -o p.csv
expect 2 "noise" simulate --robot "$robot" --truth "$truth" --poses 3 --noise N3 -o d.csv
expect 3 "absent.yaml: expected a file that can be read" predict --robot absent.yaml --joints q.csv -o p.csv
expect 3 "tool.reflectors_mm" simulate --robot "$FLEXCOMP_SOURCE_DIR/host/robots/rx160l.yaml" \
  --truth <(echo 'base: {x_mm: 1}') --poses 3 --measure reflectors -o d.csv
expect 3 "'rx', the robot of" predict --robot <(sed 's/staubli-tx60l/rx/' "$robot") --calibration "$truth" \
  --joints q.csv -o p.csv

# The same seed gives the same bytes, another seed others; --quiet says nothing.
for k in 1 2; do
  expect 0 "" simulate --robot "$robot" --truth "$truth" --poses 20 --seed 7 --context --payloads 0,1.108 -o "d$k.csv" --quiet
  [ -s out.txt ] && fail "--quiet: $(cat out.txt)"
done
cmp d1.csv d2.csv || fail "one seed, two files"
expect 0 "20 random poses" simulate --robot "$robot" --truth "$truth" --poses 20 --seed 8 --context --payloads 0,1.108 \
  -o d2.csv --json d.json
cmp -s d1.csv d2.csv && fail "two seeds, one file"
grep -q '"poses": 20' d.json || fail "no JSON: $(cat d.json)"
head -1 d1.csv | grep -q '^q1_deg.*payload_kg.*move6_deg,temp_c,time_s,x_mm.*qz,sigma_mm,sigma_deg$' || fail "$(head -1 d1.csv)"

# Without noise, predict gives the simulated file back, through any frame.
expect 0 "" simulate --robot "$robot" --truth "$truth" --poses 10 --noise none --frame -1000,20,3,10,20,-170 -o exact.csv
{
  cat "$truth"
  echo "frames: {f: {xyz_mm: [0, 0, 0], quaternion_wxyz: [0, 0, 0, 1]}, e: {xyz_mm: [0, 0, 0]}}"
} >turned.yaml
expect 0 "frame of the instrument" predict --robot "$robot" --calibration turned.yaml --joints exact.csv -o turned.csv
expect 0 "" predict --robot "$robot" --calibration "$truth" --joints exact.csv -o base.csv
# Half a turn about z: x and y change their signs.
paste -d, base.csv turned.csv | tail -n +2 | awk -F, '
  function far(a, b) { return (a - b) ^ 2 > 1e-18 }
  far($7, -$20) || far($8, -$21) || far($9, $22) { bad = 1 } END { exit bad }' || fail "the frame F is not exact"

# Joint targets and the same targets as nominal poses with seeds are one thing.
expect 0 "nominal" predict --robot "$robot" --joints exact.csv -o nominal.csv
paste -d, <(cut -d, -f7-13 nominal.csv) <(cut -d, -f1-6 nominal.csv | sed '1s/q\([1-6]\)/seed\1/g') >poses.csv
expect 0 "10 of them ok" compensate --robot "$robot" --calibration "$truth" --targets exact.csv -o c1.csv --json c.json
expect 0 "10 of them ok" compensate --robot "$robot" --calibration "$truth" --targets poses.csv -o c2.csv
[ "$(head -1 c1.csv)" = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,residual_mm,residual_deg,status" ] || fail "$(head -1 c1.csv)"
paste -d, c1.csv c2.csv | tail -n +2 | awk -F, '
  { for (k = 1; k <= 6; ++k) if (($k - $(k + 9)) ^ 2 > 1e-16) bad = 1; if ($7 > 1e-5) bad = 1 } END { exit bad }' ||
  fail "poses and joints give other commands"
# Where the flexible arm goes with the corrected commands is where the nominal one would have gone.
expect 0 "" predict --robot "$robot" --calibration "$truth" --joints c1.csv -o reached.csv
paste -d, <(cut -d, -f7-9 nominal.csv) <(cut -d, -f7-9 reached.csv) | tail -n +2 | awk -F, '
  { for (k = 1; k <= 3; ++k) if (($k - $(k + 3)) ^ 2 > 1e-10) bad = 1 } END { exit bad }' || fail "targets are missed"

awk -F, -v OFS=, 'NR == 3 { $1 = 99999 } { print }' poses.csv >far.csv
expect 3 "far.csv:3: x_mm … qz: expected a pose that the nominal arm reaches" compensate --robot "$robot" \
  --calibration "$truth" --targets far.csv -o c3.csv
[ -e c3.csv ] && fail "a refused command left a file"

# A joint command beyond its limit is the controller's to refuse: its status says so, the rest is answered.
awk -F, -v OFS=, 'NR == 2 { $5 = 150 } { print }' exact.csv >beyond.csv
expect 0 "9 of them ok" compensate --robot "$robot" --calibration "$truth" --targets beyond.csv -o c4.csv
sed -n 2p c4.csv | grep -q 'refused$' || fail "$(sed -n 2p c4.csv)"
# The column has all that hold: joint 1 at its limit and the wrist straight, the wrist alone, and both words of a program's target.
{
  echo q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg
  for q1 in -180 180 0; do echo "$q1,20,60,0,0,10"; done
} >held.csv
expect 0 "0 of them ok" compensate --robot "$robot" --calibration "$truth" --targets held.csv -o c5.csv --json held.json
[ "$(cut -d, -f9 c5.csv | sort -u | tr '\n' ' ')" = "at_limit+near_singular near_singular status " ] || fail "$(cat c5.csv)"
grep -q '"at_limit": 1' held.json || fail "the counts are by summary: $(cat held.json)"
expect 3 "beyond.csv:2: q5_deg: expected a reading within the limits of joint 5" predict --robot "$robot" \
  --joints beyond.csv -o p.csv

exit $((failures > 0))
