#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# hil/with-vcan: bytes, exit status, arguments, environment and folder come through; the bus is there; limits and
# signals end everything and leave nothing behind.
set -u
with_vcan=${FLEXCOMP_SOURCE_DIR:?}/hil/with-vcan
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
mkdir "$work/tmp" "$work/a folder"
export TMPDIR=$work/tmp FLEXCOMP_VCAN_SECONDS=60
failed=0
expect() { # expect TEXT COMMAND...: reports when the command fails
  local text=$1
  shift
  if "$@"; then echo "ok: $text"; else echo "FAILED: $text"; failed=1; return 1; fi
}
# A fresh run from the point of view of with-vcan, also where this test itself runs inside one.
unset FLEXCOMP_VCAN_INSIDE
nothing_left() { [ -z "$(ls -A "$TMPDIR")" ]; }

# One run: bytes on both outputs, arguments, environment, folder, an empty standard input, a status.
head -c 1000000 /dev/urandom >"$work/bytes"
printf 'error \377\000 text' >"$work/error"
cd "$work/a folder" || exit 1
export FLEXCOMP_TEST_TEXT=$'two\nlines with \'quotes\' and $dollars'
bash "$with_vcan" bash -c '
  cat "$1"; cat "$2" >&2; shift 2
  { printf "%s\n" "$PWD" "$FLEXCOMP_TEST_TEXT" "$#" "$@"; wc -c; } >inside; exit 37' \
  bash "$work/bytes" "$work/error" 'a b' '' '"q"' "it's" '$HOME' '*' $'tab\tnewline\n.' >"$work/out" 2>"$work/err"
expect "status 37" [ $? -eq 37 ]
expect "a megabyte of standard output, byte for byte" cmp "$work/bytes" "$work/out"
expect "standard error, byte for byte" cmp "$work/error" "$work/err"
printf '%s\n' "$PWD" "$FLEXCOMP_TEST_TEXT" 7 'a b' '' '"q"' "it's" '$HOME' '*' $'tab\tnewline\n.' 0 >"$work/expected"
expect "folder, environment, arguments, empty standard input" diff "$work/expected" inside
expect "no work folder left" nothing_left

# The bus, by programs that nobody here wrote; a nested call; a signal; the native way where the kernel can.
cat >"$work/inside.sh" <<'INSIDE'
set -u
with_vcan=$1
candump -n 1 -T 5000 vcan0 >received &
dump=$!
sleep 0.5
cansend vcan0 123#00FFAA || echo "cansend failed"
wait "$dump" || echo "candump failed"
read -r interface id length bytes <received
[ "$interface $id $length $bytes" = "vcan0 123 [3] 00 FF AA" ] || echo "frame: $interface $id $length $bytes"
before=$(cat /proc/sys/kernel/random/boot_id)
bash "$with_vcan" sh -c 'test "$(cat /proc/sys/kernel/random/boot_id)" = "$1" && exit 5' sh "$before"
[ $? -eq 5 ] || echo "a nested call is not just the command"
# Inside user-mode Linux the kernel has vcan: what with-vcan does on such a machine.
env -u FLEXCOMP_VCAN_INSIDE FLEXCOMP_VCAN=native bash "$with_vcan" sh -c 'ip -o link show vcan0 | grep -q UP && exit 6'
[ $? -eq 6 ] || echo "the native way failed"
kill -TERM $$
INSIDE
if command -v candump >/dev/null; then
  bash "$with_vcan" bash "$work/inside.sh" "$with_vcan" >"$work/out" 2>&1
  expect "a signal is 128 + its number" [ $? -eq 143 ]
  expect "a frame over vcan0, nested, native" [ ! -s "$work/out" ] || cat "$work/out"
fi

# Two at the same time have a bus each; 0 and 1 are kept.
bash "$with_vcan" sh -c 'sleep 1; exit 0' & first=$!
bash "$with_vcan" sh -c 'sleep 1; exit 1' & second=$!
wait "$first"; expect "status 0, in parallel" [ $? -eq 0 ]
wait "$second"; expect "status 1, in parallel" [ $? -eq 1 ]

bash "$with_vcan" --seconds 1 sleep 30
expect "the time limit inside gives 124" [ $? -eq 124 ]
bash "$with_vcan" flexcomp-no-such-command 2>/dev/null
expect "an unknown command gives 127" [ $? -eq 127 ]
FLEXCOMP_VCAN=sometimes bash "$with_vcan" true 2>/dev/null
expect "an unknown way gives 125" [ $? -eq 125 ]

bash "$with_vcan" sh -c 'touch started; sleep 30' & run=$!
for _ in $(seq 200); do [ -e started ] && break; sleep 0.1; done
kill -TERM "$run"
wait "$run"
expect "ended from outside: 143" [ $? -eq 143 ]
sleep 0.3
expect "nothing left after all of it" nothing_left
# By way of a file, or grep would find its own command line.
echo "uml_dir=$TMPDIR" >"$work/pattern"
none_running() { ! grep -qsF -f "$work/pattern" /proc/[0-9]*/cmdline; }
expect "no process of user-mode Linux of ours left" none_running
exit "$failed"
