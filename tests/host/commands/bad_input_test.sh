#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Bad input on the command line, as a user meets it: the exit status of the contract, and a message that says which
# file, which line, which field, and what was expected. Nothing may be left half-written.
set -uo pipefail
source "${FLEXCOMP_SOURCE_DIR:?}/tests/host/commands/common.sh"
identify() { "$flexcomp" identify --robot "$robot" --data "$1" -o "${1%.csv}.yaml" --quiet "${@:2}"; }

expect_all 0 -- "$flexcomp" simulate --robot "$robot" --truth "$truth" --poses 30 --seed 1 -o good.csv --quiet
expect_all 0 -- identify good.csv

# --- usage ---
expect_all 2 "--robot" -- "$flexcomp" identify --data good.csv -o x.yaml
expect_all 2 -- "$flexcomp" no-such-command
expect_all 3 "absent.csv" -- identify absent.csv

# --- a missing column, with line 1 and its name ---
cut -d, -f1-4,6- good.csv >missing.csv
expect_all 3 "missing.csv:1" "q5_deg" -- identify missing.csv
absent missing.yaml

# --- NaN, an empty cell, text for a number ---
awk -F, -v OFS=, 'NR==5{$8="nan"}1' good.csv >nan.csv
expect_all 3 "nan.csv:5" "y_mm" "finite" -- identify nan.csv
absent nan.yaml
awk -F, -v OFS=, 'NR==6{$2=""}1' good.csv >empty.csv
expect_all 3 "empty.csv:6" "q2_deg" -- identify empty.csv
awk -F, -v OFS=, 'NR==4{$7="12,5mm"}1' good.csv | sed 's/12,5mm/12.5mm/' >text.csv
expect_all 3 "text.csv:4" "x_mm" "12.5mm" -- identify text.csv

# --- a joint beyond its limit (joint 2: +-127.5) ---
awk -F, -v OFS=, 'NR==7{$2=127.6}1' good.csv >limit.csv
expect_all 3 "limit.csv:7" "q2_deg" "127.5" -- identify limit.csv

# --- metres for millimetres, radians for degrees; --force overrides ---
awk -F, -v OFS=, 'NR>1{$7/=1000;$8/=1000;$9/=1000}1' good.csv >metres.csv
expect_all 3 "metres.csv" "metres" "--force" -- identify metres.csv
absent metres.yaml
awk -F, -v OFS=, 'NR>1{for(i=1;i<=6;i++)$i*=3.14159265/180}1' good.csv >radians.csv
expect_all 3 "radians.csv" "radians" -- identify radians.csv

# --- too few poses, one orientation: done, but not to be trusted; what is missing and what cures it ---
head -5 good.csv >few.csv
expect_all 5 "not identifiable" "would identify them" -- identify few.csv
/usr/bin/python3 "$root"/tests/host/commands/upright_poses.py || exit 1
expect_all 0 -- "$flexcomp" predict --robot "$robot" --calibration "$truth" --joints upright.csv -o settled.csv --quiet
expect_all 5 "not identifiable" "would identify them" -- identify settled.csv

# --- two identical rows ---
{ cat good.csv; sed -n 9p good.csv; } >twice.csv
expect_all 3 "twice.csv:32" "9" -- identify twice.csv

# --- another arm's data, another arm's calibration ---
expect_all 0 -- "$flexcomp" simulate --robot "$root/host/robots/rx160l.yaml" --truth /dev/stdin --poses 30 --seed 2 \
  -o other.csv --quiet <<<'geometric: [{link: 1, theta_deg: 0.1}]'
awk -F, -v OFS=, 'NR>1{if($1>180||$2>127||$3>142||$5>122||$2<-127||$3<-142)next}1' other.csv >other_arm.csv
expect_all 3 "other_arm.csv" "another arm" -- identify other_arm.csv
expect_all 3 "good.yaml" "staubli-tx60l" -- "$flexcomp" validate --robot "$root/host/robots/rx160l.yaml" \
  --calibration good.yaml --data other.csv

# --- robot files ---
sed 's/alpha_deg: -90, beta/alpha_dge: -90, beta/' "$robot" >typo.yaml
expect_all 3 "typo.yaml" "alpha_dge" "alpha_deg" -- "$flexcomp" predict --robot typo.yaml --joints good.csv -o p.csv
absent p.csv

# --- a folder, or nothing, for a file ---
mkdir folder
for option in --robot --data; do
  for file in folder none.file; do
    args=(--robot "$robot" --data good.csv -o p.yaml)
    [[ $option == --robot ]] && args[1]=$file || args[3]=$file
    expect_all 3 "$file" "a file that can be read" -- "$flexcomp" identify "${args[@]}"
  done
done
expect_all 3 "folder" "a file that can be read" -- "$flexcomp" plan --robot "$robot" --cell folder --poses 14 -o p.csv
expect_all 3 "folder" "a file that can be read" -- "$flexcomp" import folder -o p.yaml
absent p.yaml p.csv

# --- what is known beforehand ---
expect_all 3 "--fix" "link2.d_mm" "did you mean" -- identify good.csv --fix link2.d_mm
expect_all 3 "--fix" "a number" -- identify good.csv --fix link3.d_mm=wide
expect_all 3 "--fix" "joint_compliance[joint=7]" -- identify good.csv --fix 'joint_compliance[joint=7].rad_per_nm=1e-5'
expect_all 0 -- identify good.csv --fix 'joint_compliance[joint=2].rad_per_nm=1.5e-5' --fix link5.alpha_deg
printf 'tolerances:\n  link*.d_mm: 0.3\n  lnik3.a_mm: 0.1\n' >tolerances.yaml
expect_all 3 "tolerances.yaml:3" "lnik3.a_mm" "link3.a_mm" -- identify good.csv --tolerances tolerances.yaml
printf 'tolerances:\n  link*.d_mm: -0.3\n' >tolerances.yaml
expect_all 3 "tolerances.yaml:2" "above 0" -- identify good.csv --tolerances tolerances.yaml

# --- poses without any payload know no stiffness, and are told which would ---
expect_all 0 -- "$flexcomp" simulate --robot "$robot" --truth "$truth" --poses 30 --payloads 0 -o bare.csv --quiet
expect_all 5 "joint_compliance[joint=2]" "1.108 kg" -- identify bare.csv
expect_all 0 -- identify bare.csv --model no-stiffness

# --- a study that does not exist ---
expect_all 2 "fig5" -- "$flexcomp" study fig5
expect_all 2 "--repeats" -- "$flexcomp" study fig4 --repeats 1
expect_all 2 -- "$flexcomp" simulate --robot "$robot" --truth "$truth" --poses 3 --joints good.csv -o p.csv

# --- a bus that does not answer ---
expect_all 4 "127.0.0.1" -- "$flexcomp" status --of modbus-tcp:127.0.0.1:1 --timeout 0.5
expect_all 4 "nocan7" -- "$flexcomp" status --of can:nocan7:3 --timeout 0.5

echo "$failures failures"
[[ $failures -eq 0 ]]
