#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Two implementations of the same words: the plant (KDL, its own files) and the core must put the arm at the same place,
# with every effect of the catalogue, load, temperature and motion. And the plant shares no code with what it judges.
set -euo pipefail
source=${FLEXCOMP_SOURCE_DIR:?} bin=${FLEXCOMP_BIN_DIR:?}
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
cd -- "$work"

shared=$(grep -nE '^[[:space:]]*#[[:space:]]*include[[:space:]]*"' "$source"/hil/plant/*.?pp | grep -vE '"(true_robot|files)\.hpp"' || true)
shared+=$(grep -nE '^[[:space:]]*#[[:space:]]*include[[:space:]]*<(flexcomp|Eigen|ceres)' "$source"/hil/plant/*.?pp || true)
if [ -n "$shared" ]; then printf 'the plant shares code with what it judges:\n%s\n' "$shared"; exit 1; fi

cat >all.yaml <<'YAML'
geometric:
  - {link: 1, theta_deg: -0.08, d_mm: -0.4, a_mm: 0.09, alpha_deg: 0.03}
  - {link: 2, theta_deg: -0.04, a_mm: -0.05, alpha_deg: 0.02, beta_deg: 0.03}
  - {link: 6, theta_deg: -0.1, d_mm: -0.3, a_mm: 0.03, alpha_deg: 0.07}
base: {x_mm: 0.3, y_mm: -0.2, z_mm: 0.1, rx_deg: 0.02, ry_deg: 0.01, rz_deg: 0.01}
tool: {x_mm: 0.1, y_mm: -0.2, z_mm: 0.3, rx_deg: 0.05, ry_deg: -0.04, rz_deg: 0.03}
effects:
  - {effect: joint_compliance, joint: 2, rad_per_nm: 1.5e-5}
  - {effect: joint_compliance, joint: 5, rad_per_nm: 8.5e-4}
  - {effect: link_gravity, k1_rad: 0.0015, k2_rad: 0.00123, k3_rad: 0.00054}
  - {effect: nonlinear_compliance, joint: 3, rad_per_nm3: 3.5e-7}
  - {effect: gear_harmonic, joint: 3, order: 1, sin_rad: 1.0e-4, cos_rad: 2.0e-5}
  - {effect: gear_harmonic, joint: 4, order: 2.5, sin_rad: 1.0e-4, cos_rad: -2.0e-5}
  - {effect: joint_curve, joint: 1, coefficients_rad: [1.0e-4, -2.0e-4, 3.0e-4, -1.0e-4, 2.0e-4, -3.0e-4, 5.0e-5]}
  - {effect: backlash, joint: 2, half_gap_rad: 7.0e-5}
  - {effect: readout_lag, joint: 1, rad: 1.2e-3}
  - {effect: encoder_scale, joint: 3, gain: 2.0e-4}
  - {effect: joint_coupling, joint: 6, from: 5, gain: 2.0e-4}
  - {effect: axis_wobble, joint: 2, order: 1, alpha_sin_rad: 1.0e-4, alpha_cos_rad: 2.0e-4, gamma_sin_rad: -3.0e-4, gamma_cos_rad: 4.0e-4}
  - {effect: link_bending, link: 3, alpha_rad_per_nm: 1.0e-6}
  - {effect: link_bending, link: 2, alpha_rad_per_nm: 1.0e-6, beta_rad_per_nm: 2.0e-6}
  - {effect: thermal_growth, per_k: 12.0e-6}
  - {effect: base_drift, x_mm_per_h: 0.02, y_mm_per_h: -0.03, z_mm_per_h: 0.04, rx_deg_per_h: 0.001, ry_deg_per_h: 0.002, rz_deg_per_h: 0.003}
  - {effect: base_compliance, pivot_z_mm: -375, rx_rad_per_nm: 1.0e-6, ry_rad_per_nm: 2.0e-6}
  - {effect: payload_error, mass_kg: 0.1, com_x_mm: 5, com_y_mm: -3, com_z_mm: 10}
YAML

# apart A B: the largest difference of position [mm] and of the quaternion's components between two files of poses
apart() {
  awk -F, '
    FNR == 1 { split("x_mm y_mm z_mm qw qx qy qz", name, " "); split("", at); for (k = 1; k <= NF; k++) at[$k] = k; file++; next }
    file == 1 { for (k = 1; k <= 7; k++) first[FNR, k] = $at[name[k]]; rows = FNR; next }
    { square = turned = opposite = 0
      for (k = 1; k <= 3; k++) square += ($at[name[k]] - first[FNR, k]) ^ 2
      # w near 0: q and -q are the same rotation and both may stand in a file
      for (k = 4; k <= 7; k++) { turned += ($at[name[k]] - first[FNR, k]) ^ 2; opposite += ($at[name[k]] + first[FNR, k]) ^ 2 }
      if (opposite < turned) turned = opposite
      if (square > p) p = square; if (turned > r) r = turned; seen = FNR }
    END { if (seen != rows) { print "other rows"; exit 1 }; printf "%.3g %.3g\n", sqrt(p), sqrt(r) }' "$1" "$2"
}
failed=0
judge() { # judge WHAT A B: positions within 1e-9 m, orientations within 1e-9
  local found p r
  found=$(apart "$2" "$3") || { echo "FAILED: $1: $found"; failed=1; return; }
  read -r p r <<<"$found"
  if awk "BEGIN { exit !($p <= 1e-6 && $r <= 1e-9) }"; then
    echo "ok: $1: $p mm, $r"
  else
    echo "FAILED: $1: the plant and the core are $p mm (and $r in the quaternion) apart"
    failed=1
  fi
}

tx60l=$source/host/robots/tx60l.yaml
"$bin"/flexcomp-plant measure --robot "$tx60l" --truth "$source"/tests/data/tx60l_table1.yaml --poses 500 --seed 3 \
  --noise none --measure pose -o plant.csv
"$bin"/flexcomp predict --quiet --robot "$tx60l" --calibration "$source"/tests/data/tx60l_table1.yaml --joints plant.csv \
  -o core.csv
judge "Table 1, TX60L" plant.csv core.csv

for robot in tx60l rx160l ur5 ur10; do
  for payload in 0.5 2.5; do
    "$bin"/flexcomp simulate --quiet --robot "$source"/host/robots/$robot.yaml --truth all.yaml --poses 300 --seed 5 \
      --context --payloads 0,$payload --noise none --measure pose -o core.csv
    "$bin"/flexcomp-plant where --robot "$source"/host/robots/$robot.yaml --truth all.yaml --joints core.csv \
      --nominal core.csv -o plant.csv >/dev/null
    judge "every effect, $robot, payload $payload kg" plant.csv core.csv
  done
done

# It refuses what it does not know instead of leaving it out.
refused() { # refused TEXT COMMAND...
  local text=$1 said
  shift
  if said=$("$@" 2>&1); then echo "FAILED: accepted: $*"; failed=1; return; fi
  case $said in *"$text"*) echo "ok: refused: $said" ;; *) echo "FAILED: '$text' is not in: $said"; failed=1 ;; esac
}
echo 'effects: [{effect: joint_compliance, joint: 2, rad_per_n: 1.5e-5}]' >typo.yaml
refused "rad_per_n'" "$bin"/flexcomp-plant measure --robot "$tx60l" --truth typo.yaml --poses 1 -o x.csv
echo 'effects: [{effect: joint_magic, joint: 2}]' >magic.yaml
refused "joint_magic" "$bin"/flexcomp-plant measure --robot "$tx60l" --truth magic.yaml --poses 1 -o x.csv
printf 'q1_deg,q2_deg,q3_deg,q4_deg,q5_deg\n1,2,3,4,5\n' >short.csv
refused "q6_deg" "$bin"/flexcomp-plant where --robot "$tx60l" --truth all.yaml --joints short.csv --nominal short.csv -o x.csv
"$bin"/flexcomp-plant measure --robot "$tx60l" --truth all.yaml --poses 2 -o two.csv >/dev/null
"$bin"/flexcomp-plant measure --robot "$tx60l" --truth all.yaml --poses 3 -o three.csv >/dev/null
refused "three.csv has 3" "$bin"/flexcomp-plant session --robot "$tx60l" --truth all.yaml --joints two.csv --nominal three.csv \
  --points x.txt --log x.csv
exit "$failed"
