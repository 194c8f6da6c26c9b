#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes upright.csv: poses of one orientation."""
# Poses of one orientation: joint 1 turns by d and joint 6 against it, with the wrist axis upright (q2 + q3 + q5 = 180:
# joint 6 parallel to joint 1).
rows = ["q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"]
for k in range(40):
    q2 = -40 + 2.0 * k
    q3 = 30 + 1.5 * ((7 * k) % 40)
    q5 = 180 - q2 - q3
    d = -80 + 4 * k
    rows.append(f"{d},{q2},{q3},0,{q5},{d}")
    if not -122.5 < q5 < 133.5:
        rows.pop()
open("upright.csv", "w").write("\n".join(rows) + "\n")
