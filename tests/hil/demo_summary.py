#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What ./demo left behind is good: demo_summary.py SUMMARY LOG"""
import json, os, re, sys
s = json.load(open(sys.argv[1]))
log = open(sys.argv[2]).read()
wrong = []
def expect(text, fine):
    print("ok:" if fine else "FAILED:", text)
    if not fine: wrong.append(text)
expect("before: 1 to 3 mm: %(before_mm)g" % s, 1 < s["before_mm"] < 3)
expect("after: at least twenty times better: %(after_mm)g" % s, 0 < s["after_mm"] < s["before_mm"] / 20)
expect("not better than 40 noisy poses can be", s["after_ok_mm"] > 0.002)
expect("where the controller corrects in full, half a single point's noise: %(after_ok_mm)g" % s,
       s["after_ok_mm"] < s["noise_floor_mm"] / 2)
expect("noise: sqrt(3) * 0.035 mm", abs(s["noise_floor_mm"] - 3 ** 0.5 * 0.035) < 1e-6)
# Three of the targets lie beside singularities, where the correction keeps the position and gives up orientation.
expect("orientation: four times better: %(after_deg)g" % s, s["after_deg"] < s["before_deg"] / 4)
expect("bus", s["bus"] == "can:vcan0:1")
page = open(s["report"], encoding="utf-8").read()
expect("a page with plots: %d bytes" % len(page), page.count("<svg") >= 9)
own = re.sub(r"(?s)<script.*?</script>", "", page)  # what the script does is looked at by tests/host/report
expect("nothing from the network", not re.search(r"<script|<link|<img|(src|href)=.?(https?:)?//|url\(", own))
expect("the page forbids it too", "default-src 'none'" in page)
expect("its parameters", "link6.alpha_deg" in page and "base.z_mm" in page)
expect("beside it the identification", os.path.exists(os.path.join(os.path.dirname(s["report"]), "identification.html")))
expect("the words at the end", "before: " in log and "after: " in log and s["report"] in log)
expect("says that no real data ran", "REAL DATA: not run" in log)
sys.exit(1 if wrong else 0)
