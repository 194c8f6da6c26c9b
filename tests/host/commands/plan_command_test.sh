#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The command `plan` as a user meets it: files, messages, exit status, stopping and going on.
set -u
source "${FLEXCOMP_SOURCE_DIR:?}/tests/host/commands/common.sh"

# is FILE EXPRESSION: a statement about a JSON file
is() { python3 -c "import json,sys; r=json.load(open('$1')); sys.exit(0 if ($2) else 1)" || fail "$1: not so: $2: $(cat "$1")"; }

cat >cell.yaml <<'CELL'
tracker_mm: [2500, 0, 300]
obstacles:
  - {frame: 0, from_mm: [-1000, 600, 0], to_mm: [1000, 600, 0], radius_mm: 50}
acceptance_deg: 60
CELL

# A plan is a data file without anything measured: predict reads it, and so do plan --candidates and --extend.
expect 0 "criterion" plan --robot "$robot" --cell cell.yaml --poses 14 --effort 0.1 -o plan.csv --json plan.json --report plan.html
[ "$(wc -l <plan.csv)" -eq 15 ] || fail "not 14 rows: $(cat plan.csv)"
head -1 plan.csv | grep -qx 'q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg' || fail "$(head -1 plan.csv)"
tail -n +2 plan.csv | grep -q '\.[0-9]\{4\}' && fail "finer than a thousandth of a degree: $(cat plan.csv)"
is plan.json 'r["poses"] == 14 and r["method"] == "refine" and r["identifiable"] == 36 and len(r["sigmas"]) == 36'
is plan.json 'r["criterion"] < r["random_criterion"] / 2 and abs(r["criterion"] - r["omin_expected"] / r["o1"]) < 1e-9 * r["criterion"]'
is plan.json '0 < r["feasible_share"] < 0.6 and r["refused"]["reflectors face away"] > 0.1 and not r["stopped"]'
grep -q '</html>' plan.html && grep -q 'What to expect' plan.html || fail "no page"
grep -q 'http://\|https://' <(sed '/<script>/,/<\/script>/d;s#http://www.w3.org/2000/svg##g' plan.html) && fail "the page leads into the network"
expect 0 "14 poses" predict --robot "$robot" --joints plan.csv -o poses.csv
# Its own poses are all allowed as candidates in the same cell: none is left out.
expect 0 "14 poses" plan --robot "$robot" --cell cell.yaml --poses 14 --candidates plan.csv -o again.csv --json again.json
is again.json 'r["method"] == "exchange" and not [w for w in r["warnings"] if "left out" in w]'
sort plan.csv >a.txt; sort again.csv >b.txt
cmp -s a.txt b.txt || fail "14 of 14 candidates are not these candidates"

# The same seed gives the same bytes, another one others.
expect 0 "" plan --robot "$robot" --cell cell.yaml --poses 14 --effort 0.1 -o plan2.csv --quiet
cmp -s plan.csv plan2.csv || fail "one seed, two plans"
expect 0 "" plan --robot "$robot" --cell cell.yaml --poses 14 --effort 0.1 --seed 2 -o plan2.csv
cmp -s plan.csv plan2.csv && fail "two seeds, one plan"

# Candidates: those that cannot be taken are named by line; too few are refused.
expect 0 "" plan --robot "$robot" --poses 30 --effort 0.1 --seed 3 -o free.csv
expect 0 "left out" plan --robot "$robot" --cell cell.yaml --poses 6 --candidates free.csv -o few.csv --method detmax
grep -q "line [0-9]*: " out.txt || fail "no line: $(cat out.txt)"
tail -n +2 few.csv | while read -r row; do grep -qxF -- "$row" free.csv || fail "$row is no candidate"; done
expect 3 "30 candidates or more" plan --robot "$robot" --cell cell.yaml --poses 30 --candidates free.csv -o few.csv
expect 2 "cannot choose among candidates" plan --robot "$robot" --poses 6 --candidates free.csv --method sapso -o few.csv
expect 3 "q3_deg" plan --robot "$robot" --poses 6 --candidates <(sed '4s/,[^,]*/,x/2' free.csv) -o few.csv
expect 3 "together do not" plan --robot "$robot" --poses 6 -o few.csv \
  --candidates <(head -1 free.csv; for _ in 1 2 3 4 5 6 7 8; do sed -n 2p free.csv; done)

# Payloads are chosen; a candidate list with payloads is taken at its word.
expect 0 "poses by payload" plan --robot "$robot" --poses 10 --payloads 0,1.108,4 --effort 0.1 -o loads.csv --json loads.json
head -1 loads.csv | grep -q 'payload_kg$' || fail "$(head -1 loads.csv)"
is loads.json 'sum(p["poses"] for p in r["payloads"]) == 10 and [p["payload_kg"] for p in r["payloads"]] == [0, 1.108, 4]'
tail -n +2 loads.csv | cut -d, -f7 | sort -c -n || fail "the payload changes to and fro: $(cat loads.csv)"
expect 0 "poses by payload" plan --robot "$robot" --poses 8 --candidates loads.csv -o loads2.csv
tail -n +2 loads2.csv | while read -r row; do grep -qxF -- "$row" loads.csv || fail "$row is no candidate"; done

# The next poses after what is measured.
expect 0 "" simulate --robot "$robot" --truth "$FLEXCOMP_SOURCE_DIR/tests/data/tx60l_table1.yaml" --poses 10 -o measured.csv
expect 0 "alone (10 poses)" plan --robot "$robot" --extend measured.csv --poses 4 --effort 0.1 -o next.csv --json next.json
is next.json 'r["poses"] == 4 and r["before"]["poses"] == 10 and r["criterion"] < r["before"]["criterion"] / 2'
expect 0 "alone (14 poses)" plan --robot "$robot" --extend plan.csv --poses 1 --effort 0.1 -o next.csv
expect 0 "" simulate --robot "$robot" --truth "$FLEXCOMP_SOURCE_DIR/tests/data/tx60l_table1.yaml" --poses 20 \
  --measure position -o positions.csv
expect 0 "35 of 39" plan --robot "$robot" --extend positions.csv --poses 2 --effort 0.1 -o next.csv --json next.json
is next.json 'r["measure"] == "position"'

# What is measured and identified.
expect 0 "35 of 39" plan --robot "$robot" --poses 20 --measure position --effort 0.1 -o p.csv
expect 0 "36 of 39" plan --robot "$robot" --poses 14 --measure reflectors --effort 0.1 -o p.csv
expect 0 "28 of 30" plan --robot "$robot" --poses 14 --model geometric --effort 0.1 -o p.csv
expect 0 "beside 12 frame parameters" plan --robot "$robot" --poses 14 --frames fit --effort 0.1 -o p.csv
expect 3 "tool.reflectors_mm" plan --robot "$FLEXCOMP_SOURCE_DIR/host/robots/rx160l.yaml" --poses 14 --measure reflectors -o p.csv

# Too few poses are refused with the least number, on either side of it.
expect 2 "the least number is 6" plan --robot "$robot" --poses 5 -o p.csv
expect 0 "nothing will be left to check" plan --robot "$robot" --poses 6 --effort 0.1 -o p.csv
expect 2 "the least number is" plan --robot "$robot" --poses 3 --measure position -o p.csv
expect 2 "--poses" plan --robot "$robot" --poses 0 -o p.csv
expect 2 "--method" plan --robot "$robot" --poses 14 --method best -o p.csv
expect 3 "absent.yaml" plan --robot "$robot" --cell absent.yaml --poses 14 -o p.csv
expect 3 "acceptance_deg" plan --robot "$robot" --cell <(echo 'acceptance_deg: -3') --poses 14 -o p.csv
expect 3 "feasible poses of" plan --robot "$robot" --poses 14 -o p.csv \
  --cell <(echo 'tracker_mm: [0, 0, 20000]'; echo 'acceptance_deg: 0.1')

# Stopped by Ctrl-C: the best plan so far is there, exit status 0, and a resumed search ends where an unbroken one does.
expect 0 "" plan --robot "$robot" --poses 14 --effort 2 -o whole.csv --json whole.json
"$flexcomp" plan --robot "$robot" --poses 14 --effort 2 -o part.csv --json part.json --state state.json >out.txt 2>&1 &
pid=$!
sleep 0.7
kill -INT $pid
wait $pid
got=$?
[ $got -eq 0 ] || fail "stopped: exit status $got: $(cat out.txt)"
if grep -q "^stopped" out.txt; then
  is part.json 'r["stopped"] and r["poses"] == 14'
  [ "$(wc -l <part.csv)" -eq 15 ] || fail "no plan after Ctrl-C: $(cat part.csv)"
  expect 0 "" plan --robot "$robot" --poses 14 --effort 2 -o part.csv --json part.json --resume state.json
  is part.json 'not r["stopped"] and r["resumed_at"] > 0'
else
  grep -q "criterion" out.txt || fail "neither stopped nor done: $(cat out.txt)"
fi
cmp -s whole.csv part.csv || fail "a resumed search ends elsewhere"
# A state of another task, or none at all.
expect 3 "poses: expected the state of this very task: 15" plan --robot "$robot" --poses 15 --effort 2 -o p.csv --resume state.json
expect 3 "seed" plan --robot "$robot" --poses 14 --effort 2 --seed 9 -o p.csv --resume state.json
expect 3 "a state that" plan --robot "$robot" --poses 14 -o p.csv --resume plan.csv
expect 3 "absent.json" plan --robot "$robot" --poses 14 -o p.csv --resume absent.json
expect 3 "a state that" plan --robot "$robot" --poses 14 -o p.csv --resume <(echo '{"task": 3}')

# All methods side by side.
expect 0 "exchange" plan --robot "$robot" --poses 8 --effort 0.005 --compare -o p.csv --json p.json
is p.json '[c["method"] for c in r["compared"]] == ["random (median)", "detmax", "sapso", "exchange", "refine"]'
is p.json 'all(c["criterion"] > 0 for c in r["compared"])'

[ $failures -eq 0 ] && echo "all well"
exit $((failures > 0))
