# SPDX-License-Identifier: Apache-2.0
"""What hil/closed-loop found, judged.

    closed_loop.py closed_loop.json
"""
import json
import sys

with open(sys.argv[1]) as file:
    s = json.load(file)
wrong = 0


def expect(text, fine):
    global wrong
    print("ok:" if fine else "FAILED:", text)
    wrong += not fine


# What one measured point is off by: three times the variance of an axis.
point = 3 ** 0.5 * s["noise_mm"]
expect(f"before: 1 to 3 mm: {s['before_mm']:g}", 1 < s["before_mm"] < 3)
expect(f"after: at least twenty times better: {s['after_mm']:g}", 0 < s["after_mm"] < s["before_mm"] / 20)
expect(f"and better than a single measured point: {point:g}", s["after_mm"] < point)
expect(f"nearly all targets are corrected in full: {s['targets_ok']} of {s['targets']}", s["targets_ok"] > 0.8 * s["targets"])
expect(f"there, better than half of a measured point: {s['after_ok_mm']:g}", s["after_ok_mm"] < point / 2)
expect("and not better than 40 noisy poses can be", s["after_ok_mm"] > 0.002)
if "diagnosed" in s:
    d = s["diagnosed"]
    # What the fit of four reflectors leaves of the noise: half of it per axis.
    floor = point / 2
    expect("diagnose names what was hidden", d["verdict"] == "named")
    expect("both sets are judged at nearly all targets: %(targets)d" % d, d["targets"] > 0.8 * s["targets"])
    expect("the first set's error at targets is what held-out rows said: promised %(promised_before_mm)g, is %(before_mm)g" % d,
           abs(d["before_mm"] - d["promised_before_mm"]) < 0.15 * d["promised_before_mm"])
    expect("and so is the second's: promised %(promised_after_mm)g, is %(after_mm)g" % d,
           abs(d["after_mm"] ** 2 - d["promised_after_mm"] ** 2) < 0.5 * floor ** 2)
    shrunk = {when: 1 - (d[when + "after_mm"] / d[when + "before_mm"]) ** 2 for when in ("", "promised_")}
    expect(f"the gap shrinks by what was promised: {shrunk['promised_']:.3f}, does by {shrunk['']:.3f}",
           shrunk["promised_"] > 0.9 and abs(shrunk[""] - shrunk["promised_"]) < 0.1)
sys.exit(wrong != 0)
