#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# flexcomp export: the header in the repository is what the command writes, every robot's header is C90 and C++ without
# a warning, and what cannot be written is refused by name.
set -u
source "${FLEXCOMP_SOURCE_DIR:?}/tests/host/commands/common.sh"
robots=$root/host/robots

"$flexcomp" export --robot "$robots/tx60l.yaml" --as c -o tx60l.h --json tx60l.json --quiet || fail "exit status $?"
cmp tx60l.h "$FLEXCOMP_SOURCE_DIR/firmware/examples/tx60l.h" ||
  fail "firmware/examples/tx60l.h is not what the command writes: export it again"
hash=$(sed -n 's/^ \* nominal hash \([0-9a-f]\{64\}\) \*\/$/\1/p' tx60l.h)
grep -q "\"nominal_hash\": \"$hash\"" tx60l.json || fail "header and JSON name different hashes: $(cat tx60l.json)"

for robot in "$robots"/*.yaml; do
  name=$(basename "$robot" .yaml)
  "$flexcomp" export --robot "$robot" --as c -o "$name.h" >out.txt || fail "$name: exit status $?"
  constant=$(sed -n 's/^.* as the C constant \([^,]*\),.*$/\1/p' out.txt)
  # Twice, because the guard has to work as well.
  printf '#include "%s.h"\n#include "%s.h"\nconst flexcomp_robot* robot(void);\nconst flexcomp_robot* robot(void) { return &%s; }\n' \
    "$name" "$name" "$constant" | tee "$name.c" >"$name.cpp"
  include=(-I "$FLEXCOMP_SOURCE_DIR/firmware/include" -Wall -Wextra -pedantic-errors -Werror -c -o /dev/null)
  cc -std=c90 "${include[@]}" "$name.c" || fail "$name.h is not C90"
  c++ -std=c++17 "${include[@]}" "$name.cpp" || fail "$name.h is not C++17"
done

"$flexcomp" export --robot "$robots/tx60l.yaml" --as rust -o robot.rs >out.txt 2>&1
[ $? -eq 2 ] || fail "--as rust is no usage error"
grep -q rust out.txt || fail "the format is not named: $(cat out.txt)"
[ -e robot.rs ] && fail "a refused format leaves a file"
"$flexcomp" export --robot absent.yaml --as c -o absent.h >out.txt 2>&1
[ $? -eq 3 ] || fail "an absent robot is not status 3"
"$flexcomp" export --help | grep -q 'flexcomp_init' || fail "the help does not say what to do with the header"

# The other formats: what each needs is a usage error by name, what is no URDF of this arm is refused, files appear whole.
data=$FLEXCOMP_SOURCE_DIR/tests/data
expect 2 "--robot (with --as c) is required" export --as c -o x.h
expect 2 "--calibration (with --as urdf) is required" export --as urdf --robot "$robots/tx60l.yaml" -o x.urdf
expect 2 "--urdf (with --as urdf) is required" export --as urdf --robot "$robots/tx60l.yaml" --calibration "$data/tx60l_table1.yaml" -o x.urdf
expect 2 ".csv, .json or .md" export --as modbus -o map.txt
expect 3 "another arm" export --as urdf --robot "$robots/tx60l.yaml" --calibration "$data/tx60l_table1.yaml" --urdf "$data/ur5.urdf" -o x.urdf
[ -e x.urdf ] && fail "a refused URDF leaves a file"
expect 0 "a URDF cannot hold the rest, up to" export --as urdf --robot "$robots/tx60l.yaml" --calibration "$data/tx60l_table1.yaml" \
  --urdf "$data/tx60l.urdf" -o corrected.urdf --json urdf.json
expect 0 "link_gravity" export --as urdf --robot "$robots/tx60l.yaml" --calibration "$data/tx60l_table1.yaml" --urdf "$data/tx60l.urdf" -o corrected.urdf
# Back through the import: the corrected URDF is a robot whose geometry is the identified one.
"$flexcomp" import corrected.urdf -o corrected.yaml --quiet || fail "the corrected URDF is not read"
grep -q '"largest_mm"' urdf.json || fail "$(cat urdf.json)"
expect 0 "electronic data sheet" export --as eds -o flexcomp.eds
for ending in csv json md; do expect 0 "register map" export --as modbus -o "map.$ending"; done
/usr/bin/python3 "$FLEXCOMP_SOURCE_DIR"/tests/host/commands/read_exports.py || fail "the data sheet or the map is not read by others"

[ "$failures" -eq 0 ] && echo "headers of $(ls "$robots"/*.yaml | wc -l) robots"
[ "$failures" -eq 0 ]
