#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# flexcomp import as a user meets it: a URDF becomes a robot file that the other commands take, and what is no arm is
# refused with the exit status of the contract, in one message, leaving no file.
set -uo pipefail
source "${FLEXCOMP_SOURCE_DIR:?}/tests/host/commands/common.sh"

expect 0 "Example" import --help
expect 2 "source is required" import -o r.yaml
expect 2 "--output is required" import "$root/tests/data/ur5.urdf"

# Each arm, and the whole way from there: data, calibration, the same error as from the project's own file.
for arm in kuka_kr6_r900:kuka-kr6-r900 abb_irb120:abb-irb120 tx60l:tx60l ur5:ur5; do
  expect 0 "to link" import "$root/tests/data/${arm%:*}.urdf" -o "${arm#*:}.yaml" --json "${arm#*:}.json"
  grep -q '"f0_is_base": ' "${arm#*:}.json" || fail "no JSON: $(cat "${arm#*:}.json")"
  grep -q '"joints": \[' "${arm#*:}.json" || fail "no joints: $(cat "${arm#*:}.json")"
done
expect 0 "F0 is not base_link" import "$root/tests/data/kuka_kr6_r900.urdf" -o kuka.yaml --name kuka
grep -q '^# xyz_mm \[0, 0, 0\], quaternion_wxyz \[0, 1, 0, 0\]$' kuka.yaml || fail "no transform: $(cat kuka.yaml)"
grep -q '^name: "kuka"$' kuka.yaml || fail "--name: $(cat kuka.yaml)"
grep -q '"f0_is_base": false' kuka-kr6-r900.json || fail "$(cat kuka-kr6-r900.json)"
expect 0 "" import "$root/tests/data/abb_irb120.urdf" -o quiet.yaml --quiet
[[ ! -s out.txt ]] || fail "--quiet: $(cat out.txt)"
cmp -s quiet.yaml abb-irb120.yaml || fail "one URDF, two files"

cat >truth.yaml <<'TRUTH'
geometric:
  - {link: 2, theta_deg: 0.05, a_mm: 0.3, beta_deg: 0.02}
  - {link: 4, d_mm: -0.2, alpha_deg: 0.03}
TRUTH
expect 0 "60 random poses" simulate --robot kuka.yaml --truth truth.yaml --poses 60 -o data.csv
expect 0 "identifiable" identify --robot kuka.yaml --data data.csv --model no-stiffness -o calibration.yaml
expect 0 "60 random poses" simulate --robot kuka.yaml --truth truth.yaml --poses 60 --seed 2 -o others.csv
expect 0 "after" validate --robot kuka.yaml --calibration calibration.yaml --data others.csv

# Refusals: one message, of ours, and no file.
refuse() {
  local pattern=$1
  shift
  expect 3 "$pattern" import "$@" -o refused.yaml
  [[ $(grep -c . out.txt) -eq 1 ]] || fail "more than one message: $(cat out.txt)"
  [[ ! -e refused.yaml ]] || fail "a refused import left a file"
}
refuse "absent.urdf: expected a file that can be read" absent.urdf
echo "<robot name='x'><link name='a'></robot>" >broken.urdf
refuse "broken.urdf:1: expected XML" broken.urdf
sed 's/joint_3" type="revolute/joint_3" type="prismatic/' "$root/tests/data/abb_irb120.urdf" >slides.urdf
refuse "joint 'joint_3': expected a joint that is revolute, continuous or fixed, found one that is prismatic" slides.urdf --tip tool0
refuse "did you mean 'tool0'" "$root/tests/data/abb_irb120.urdf" --tip tol0
refuse "--tip: expected a link that is six" "$root/tests/data/abb_irb120.urdf" --base link_1
expect 2 "links of a URDF" import "$root/host/robots/ur5.yaml" --tip x -o refused.yaml

# A table whose near-parallel axes ran off: refused with the way out, which works.
sed '0,/d_mm: 0, a_mm: -425, alpha_deg: 0,/s//d_mm: 100000, a_mm: -425, alpha_deg: 0.01,/' "$root/host/robots/ur5.yaml" |
  sed '0,/d_mm: 0, a_mm: -392.25,/s//d_mm: -100000, a_mm: -392.25,/' >long.yaml
expect 3 "'flexcomp import' of this file" predict --robot long.yaml --joints data.csv -o p.csv
expect 0 "links put anew" import long.yaml -o short.yaml
expect 0 "" predict --robot short.yaml --joints data.csv -o p.csv
expect 1 "cannot be written" import long.yaml -o "$work/absent/short.yaml"

[[ $failures -eq 0 ]] || { echo "$failures failures"; exit 1; }
echo "import: all as expected"
