#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# `flexcomp diagnose` as a user meets it: simulated arms with one hidden effect, the answer for people and machines, what
# held-out rows may and may not change, bad input, exit statuses, the files that are left.
set -uo pipefail
source "${FLEXCOMP_SOURCE_DIR:?}/tests/host/commands/common.sh"
diagnose() { "$flexcomp" diagnose --robot "$robot" "$@"; }
simulate() { "$flexcomp" simulate --robot "$robot" --quiet --noise N1 "$@"; }
# judge CASE FILE…
judge() {
  if /usr/bin/python3 "$root"/tests/host/commands/diagnose_answers.py "$@"; then echo "ok: $1"; else fail "$1: $(head -c 3000 "$2")"; fi
}

without() { # without PATTERN: columns whose names match are left out of the file on standard input
  awk -F, -v pattern="$1" '
    NR == 1 { for (k = 1; k <= NF; k++) if ($k ~ pattern) out[k] }
    { line = ""; for (k = 1; k <= NF; k++) if (!(k in out)) line = line (line == "" ? "" : ",") $k; print line }'
}
hidden() { # hidden EFFECT: the paper's arm with one effect more
  cat "$root"/tests/data/tx60l_table1.yaml
  echo "  - $1"
}
hidden '{effect: gear_harmonic, joint: 3, order: 2, sin_rad: 3.0e-4, cos_rad: 1.0e-4}' >harmonic.yaml
simulate --truth harmonic.yaml --poses 100 --seed 3 --context --payloads 0,1.108 -o d.csv
simulate --truth harmonic.yaml --poses 60 --seed 4 --context --payloads 0,1.108 -o h.csv

# --- the whole answer -------------------------------------------------------------------------------------------------
expect_all 0 "joint 3 has an error that comes twice per turn" "gear_harmonic[joint=3,order=2]" "arcsec" "held-out rows" \
  "a.yaml: written" "r.html: written" "flexcomp push --to BUS a.yaml" -- \
  diagnose --data d.csv --holdout h.csv -o a.yaml --json a.json --report r.html --seed 5
judge named_and_nothing_else a.json
judge the_gap_shrinks_where_nothing_was_fitted a.json
grep -q '<svg' r.html || fail "no drawing in r.html"
# The script that the page carries is looked at by tests/host/report.
sed '/<script>/,/<\/script>/d' r.html | grep -Eq '<link|<img|(src|href)=.?(https?:)?//|url\(' && fail "r.html needs something from elsewhere"

# --- held-out rows change the held-out numbers alone; one seed, one result ------------------------------------------------
expect_all 0 -- diagnose --data d.csv -o b.yaml --json b.json --seed 5 --quiet
[[ ! -s out.txt ]] || fail "--quiet: $(cat out.txt)"
judge the_same_without_holdout a.json b.json
diff <(grep -v '^date:' a.yaml) <(grep -v '^date:' b.yaml) || fail "--holdout changes the calibration"

# What was written is a calibration like any other.
expect_all 0 "chi-square" -- "$flexcomp" validate --robot "$robot" --calibration a.yaml --data h.csv --json v.json
judge and_validates_to_the_numbers_that_were_promised a.json v.json
expect_all 0 "of them ok" -- "$flexcomp" compensate --robot "$robot" --calibration a.yaml --targets h.csv -o c.csv

# --- nothing hidden; from a calibration; nothing to tell apart ------------------------------------------------------------
simulate --truth "$root"/tests/data/tx60l_table1.yaml --poses 100 --seed 3 --context --payloads 0,1.108 -o plain.csv
"$flexcomp" identify --robot "$robot" --data plain.csv -o start.yaml --quiet
expect_all 0 "Nothing is missing" "poses.csv: not written" -- \
  diagnose --calibration start.yaml --data plain.csv -o n.yaml --json n.json --plan poses.csv
absent poses.csv
judge none n.json

# --- too few rows: what fits as well as it must proves nothing ------------------------------------------------------------
head -n 4 plain.csv >three.csv
expect_all 5 "Nothing was found, but these data cannot say that nothing is missing" "not identifiable from these 3 rows" -- \
  diagnose --data three.csv -o t.yaml --report t.html
grep -q "Nothing is missing" t.html && fail "t.html: three rows are said to show that nothing is missing"

# --- without context columns: what could not be asked, and what it needs --------------------------------------------------
without '^(move|temp|time)' <plain.csv >bare.csv
head -1 bare.csv | grep -q 'move\|temp' && fail "bare.csv has context"
expect_all 0 "not tested: readout_lag needs move1_deg … move6_deg" -- diagnose --data bare.csv -o m.yaml --json m.json
judge not_testable_names_the_columns m.json

# --- two names for one thing: said, and poses that tell them apart ----------------------------------------------------------
# Joint 3 near 0 only: there a wrong scale and a slow wave look alike.
hidden '{effect: encoder_scale, joint: 3, gain: 1.0e-3}' >scale.yaml
awk -F, -v OFS=, 'NR > 1 { $3 = $3 / 4 } 1' d.csv | without '^([xyz]_mm|q[wxyz]|sigma)' >narrow_q.csv
simulate --truth scale.yaml --joints narrow_q.csv --seed 6 -o narrow.csv
expect_all 0 -- diagnose --data narrow.csv -o s.yaml --json s.json --plan tell.csv
judge every_effect_is_joint_3_s_and_rivals_are_named s.json
[[ "$(head -1 tell.csv)" = q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,payload_kg ]] || fail "tell.csv: $(head -1 tell.csv)"
grep -qF "tell.csv: " out.txt || fail "nothing is said of tell.csv"
expect_all 0 "poses of tell.csv" -- "$flexcomp" simulate --robot "$robot" --truth scale.yaml --joints tell.csv -o told.csv

# --- what has no name: located, described, and pushed only by who says so -------------------------------------------------------
# A cable that pulls at joint 3 where joint 2 is near 0 and the hand is loaded.
hidden '{effect: unnamed, place: link3.theta, of: [q2, payload_kg], grid: [[-100, -40, 0, 40, 100], [0, 1.108]], values_rad: [[0, 0], [0, 0], [0, 1.5e-3], [0, 0], [0, 0]]}' >cable.yaml
simulate --truth cable.yaml --poses 150 --seed 3 --context --payloads 0,1.108 -o cable.csv
simulate --truth cable.yaml --poses 60 --seed 4 --context --payloads 0,1.108 -o cable_h.csv
expect_all 0 "no effect of the catalogue explains" "link3.theta, joint 3 moves wrongly" "--allow-unnamed" -- \
  diagnose --data cable.csv --holdout cable_h.csv -o k.yaml --json k.json --report k.html
judge unnamed_where_it_is_and_what_it_follows k.json
expect_all 3 "--allow-unnamed" -- "$flexcomp" compensate --robot "$robot" --calibration k.yaml --targets cable_h.csv -o kc.csv
absent kc.csv
expect_all 0 "of them ok" -- "$flexcomp" compensate --robot "$robot" --calibration k.yaml --targets cable_h.csv -o kc.csv --allow-unnamed

# --- not to be trusted: noise declared three times too large ----------------------------------------------------------------
awk -F, -v OFS=, 'NR == 1 { for (k = 1; k <= NF; k++) if ($k ~ /^sigma/) s[k] } NR > 1 { for (k in s) $k *= 3 } 1' plain.csv >wide.csv
expect_all 5 "not trustworthy" -- diagnose --data wide.csv -o w.yaml --json w.json --report w.html
for file in w.yaml w.json w.html; do [[ -s $file ]] || fail "$file was not written"; done

# --- bad input: nothing is written ------------------------------------------------------------------------------------------
expect_all 2 "--data" -- diagnose -o x.yaml
expect_all 2 "--output" -- diagnose --data d.csv
expect_all 3 "absent.csv" "a file that can be read" -- diagnose --data absent.csv -o x.yaml
expect_all 3 "h.csv" "held-out rows must not be those of --data" "the same file" -- diagnose --data h.csv --holdout ./h.csv -o x.yaml
{ cat h.csv; sed -n 9p d.csv; } >mixed.csv
expect_all 3 "mixed.csv:62" "the measurement of d.csv:9" -- diagnose --data d.csv --holdout mixed.csv -o x.yaml
cut -d, -f1-6 h.csv >joints.csv
expect_all 3 "joints.csv:1" "x_mm" -- diagnose --data d.csv --holdout joints.csv -o x.yaml
awk -F, -v OFS=, 'NR == 5 { $2 = "nan" } 1' h.csv >nan.csv
expect_all 3 "nan.csv:5" "q2_deg" "finite" -- diagnose --data d.csv --holdout nan.csv -o x.yaml
expect_all 3 "q5_deg" -- diagnose --data <(cut -d, -f1-4,6- d.csv) -o x.yaml
"$flexcomp" simulate --robot "$root/host/robots/rx160l.yaml" --truth /dev/stdin --poses 30 --seed 2 -o other.csv --quiet \
  <<<'geometric: [{link: 1, theta_deg: 0.1}]'
awk -F, 'NR == 1 || !($1 > 180 || $2 > 127 || $3 > 142 || $5 > 122 || $2 < -127 || $3 < -142)' other.csv >other_arm.csv
expect_all 3 "other_arm.csv" "another arm" -- diagnose --data d.csv --holdout other_arm.csv -o x.yaml
expect_all 3 "other_arm.csv" "another arm" -- diagnose --data other_arm.csv -o x.yaml
simulate --truth harmonic.yaml --poses 20 --seed 8 --frame 500,0,0,0,0,10 -o moved.csv
expect_all 3 "moved.csv" "was the instrument moved" -- diagnose --data d.csv --holdout moved.csv -o x.yaml
sed 's/staubli-tx60l/another/' start.yaml >another.yaml
expect_all 3 "another.yaml" "staubli-tx60l" -- diagnose --calibration another.yaml --data d.csv -o x.yaml
sed 's/^nominal_hash: "\?./&0/; s/^\(nominal_hash: "\?.\{64\}\)./\1/' start.yaml >hash.yaml
expect_all 3 "hash.yaml" -- diagnose --calibration hash.yaml --data d.csv -o x.yaml
absent x.yaml

# A held-out file without the columns that effects follow is judged with defaults, and that is said.
"$flexcomp" simulate --robot "$robot" --truth harmonic.yaml --poses 30 --seed 9 -o few.csv --quiet
expect_all 0 "few.csv: has no payload_kg" -- diagnose --calibration start.yaml --data plain.csv --holdout few.csv -o y.yaml

echo "$failures failures"
[[ $failures -eq 0 ]]
