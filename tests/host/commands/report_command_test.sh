#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# `flexcomp report` as a user meets it: what it writes, and what it refuses before it writes.
set -uo pipefail
source "${FLEXCOMP_SOURCE_DIR:?}/tests/host/commands/common.sh"
header=q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,dx_mm,dy_mm,dz_mm
printf '%s\n%s\n%s\n' "$header" 1,2,3,4,5,6,1,0,0 10,20,30,40,50,60,0,2,0 >before.csv
printf '%s\n%s\n%s\n' "$header" 1,2,3,4,5,6,.1,0,0 10,20,30,40,50,60,0,.2,0 >after.csv

expect 0 "page.html: written" report --robot "$robot" --errors Moves=before.csv,after.csv --link other.html=Other -o page.html --json page.json
[[ "$(/usr/bin/python3 -c 'import json; j = json.load(open("page.json")); print(j["page"], j["bytes"])')" == "page.html $(stat -c %s page.html)" ]] ||
  fail "page.json: $(cat page.json)"
grep -q 'href="other.html"' page.html || fail "the link is not on the page"

cp before.csv kept.csv
expect 2 before.csv report --robot "$robot" --errors Moves=before.csv,after.csv -o before.csv
expect 2 after.csv report --robot "$robot" --errors Moves=before.csv,after.csv -o p.html --json after.csv
cmp -s before.csv kept.csv || fail "an input was overwritten"
for href in https://example.org //example.org '/\example.org' '\\example.org' $'\x01//example.org' ' //example.org'; do
  expect 3 "a page beside this one" report --robot "$robot" --link "$href=There" -o away.html
done
expect 3 "TITLE=BEFORE.csv,AFTER.csv" report --robot "$robot" --errors before.csv -o away.html
[[ ! -e away.html ]] || fail "away.html was written"

echo "$failures failures"
[[ $failures -eq 0 ]]
