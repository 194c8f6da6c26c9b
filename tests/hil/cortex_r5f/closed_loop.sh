#!/usr/bin/env bash
# Measured, identified, pushed into the emulated Cortex-R5F over CAN; its commands move the true arm.
. "${BASH_SOURCE[0]%/*}/common.sh"
hil=$FLEXCOMP_SOURCE_DIR/hil
bash "$hil/closed-loop" --bin "$FLEXCOMP_BIN_DIR" --out "$work" can:vcan0:1 \
  bash "$hil/with-vcan" --seconds 240 "$hil/emulators/cortex-r5f-canopen" --image "$FLEXCOMP_IMAGE"
/usr/bin/python3 - "$work/closed_loop.json" <<'PYTHON'
import json, sys
s = json.load(open(sys.argv[1]))
wrong = []
def expect(text, fine):
    print("ok:" if fine else "FAILED:", text)
    if not fine: wrong.append(text)
expect("before: 1 to 3 mm: %(before_mm)g" % s, 1 < s["before_mm"] < 3)
expect("after: at least twenty times better: %(after_mm)g" % s, 0 < s["after_mm"] < s["before_mm"] / 20)
expect("nearly all targets are corrected in full: %(targets_ok)d of %(targets)d" % s, s["targets_ok"] > 0.8 * s["targets"])
expect("there, better than half of a single point's noise: %(after_ok_mm)g" % s,
       s["after_ok_mm"] < 3 ** 0.5 * s["noise_mm"] / 2)
expect("and not better than 40 noisy poses can be", s["after_ok_mm"] > 0.002)
sys.exit(1 if wrong else 0)
PYTHON
# The process and the emulator run the same library on the same image: their commands are the host's, to the last digit.
"$FLEXCOMP_BIN_DIR/flexcomp" compensate --robot "$FLEXCOMP_SOURCE_DIR/host/robots/tx60l.yaml" --quiet \
  --calibration "$work/calibration.yaml" --targets "$work/targets.csv" -o "$work/expected.csv"
cmp "$work/commands.csv" "$work/expected.csv" && echo "ok: the R5F's commands are compensate's, character for character"
