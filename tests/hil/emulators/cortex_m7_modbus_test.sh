#!/usr/bin/env bash
# The emulated Cortex-M7 controller on Modbus RTU: our own client, mbpoll and pymodbus (modbus_rtu.py).
set -eu
here=$(dirname "$0")
. "$here/host_programs.sh"
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
/usr/bin/python3 "$here/../buses.py" prepare "$work"
"$FLEXCOMP_SOURCE_DIR"/hil/emulators/cortex-m7-modbus --image "$FLEXCOMP_IMAGE" --seconds 270 \
  /usr/bin/python3 "$here/modbus_rtu.py" "$work"

# The way a person starts it: it says where the line is, and nothing of it is left when it ends.
"$FLEXCOMP_SOURCE_DIR"/hil/emulators/cortex-m7-modbus --image "$FLEXCOMP_IMAGE" --device "$work/line" --seconds 120 \
  >"$work/ready" &
emulator=$!
for _ in $(seq 600); do
  if grep -q '^ready' "$work/ready" || ! kill -0 "$emulator" 2>/dev/null; then break; fi
  sleep 0.1
done
grep "^ready modbus-rtu:$work/line:115200:N:1 console=" "$work/ready"
"$FLEXCOMP_BIN_DIR"/flexcomp status --of "modbus-rtu:$work/line:115200:N:1" >"$work/status"
grep -q staubli-tx60l "$work/status"
kill -TERM "$emulator"
status=0
wait "$emulator" || status=$?
[ "$status" -eq 143 ]
left=$(grep -ls -- "$work/[l]ine" /proc/[0-9]*/cmdline || true)
if [ -n "$left" ] || [ -L "$work/line" ] || [ -e "$(sed 's/.*console=//' "$work/ready")" ]; then
  echo "FAILED something is left of the emulator: $left"
  exit 1
fi
echo "PASS an emulator that is ended leaves nothing behind"
