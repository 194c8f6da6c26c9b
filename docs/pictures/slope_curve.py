#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The curve of slope against residual (docs/compensation.md, section 3): measures it and draws it.

  docs/pictures/slope_curve.py SLOPE_SEARCH   runs the search for every setting and arm (some ten minutes), writes the rows
                                              `slope_against_residual` of docs/figures.json, and every table and picture anew

SLOPE_SEARCH is build/host/bin/slope_search. The same program gives the same rows. docs/write_tables.py draws slope.svg of them.
"""
import math
import pathlib
import re
import subprocess
import sys

STEEPEST = [200, 100, 50, 30, 20, 10]
EVALUATIONS = 200000  # of the slope, for each arm and setting
POSES = 50000
LINE = re.compile(r"^(\S+) +slope ([\d.]+) .* left: ([\d.]+) % above 0.02 mm, ([\d.]+) % above 1 mrad, most ([\d.]+) mm")

WIDTH, HEIGHT = 790, 440
LEFT, RIGHT, TOP, BOTTOM = 64, 640, 46, 380
COLOURS = ["#1b2433", "#b3541e", "#1f6fb2", "#2f8f5b", "#8a4fa3", "#9a7b00"]


def measure(program):
    """Rows of one arm and one setting each."""
    rows = []
    for steepest in STEEPEST:
        answer = subprocess.run([program, "--steepest", str(steepest), "--evaluations", str(EVALUATIONS), "--poses", str(POSES)],
                                check=True, capture_output=True, text=True).stdout
        for line in answer.splitlines():
            found = LINE.match(line)
            if not found:
                raise SystemExit(f"slope_search said: {line}")
            rows.append({"arm": found[1], "steepest": steepest, "slope": float(found[2]), "position_percent": float(found[3]),
                         "orientation_percent": float(found[4]), "most_mm": float(found[5])})
            print(rows[-1], flush=True)
    return rows


def by_arm(rows):
    arms = {}
    for row in rows:
        arms.setdefault(row["arm"], []).append(row)
    return arms


def table(rows):
    """Header and cells: one line for each setting."""
    lines = []
    for steepest in sorted({row["steepest"] for row in rows}, reverse=True):
        these = [row for row in rows if row["steepest"] == steepest]
        one = next(row for row in these if row["arm"] == "TX60L")
        span = lambda key: f"{min(r[key] for r in these):.1f} to {max(r[key] for r in these):.1f} %"
        lines.append([steepest, f"{one['slope']:.3g}", f"{max(r['slope'] for r in these):.3g}", f"{one['position_percent']:.1f} %",
                      span("position_percent"), span("orientation_percent")])
    return (["`steepest`", "greatest slope found: TX60L", "of six arms", "more than 0.02 mm left: TX60L", "six arms",
             "more than 1 mrad left, six arms"], lines)


def svg(rows):
    """The picture: greatest slope found, logarithmic, against the share of poses with more than 0.02 mm left."""
    slopes = [row["slope"] for row in rows]
    low, high = min(2, min(slopes)), 1.15 * max(slopes)
    most = 2 * math.ceil(max(row["position_percent"] for row in rows) / 2)
    x = lambda slope: LEFT + (RIGHT - LEFT) * math.log(slope / low) / math.log(high / low)
    y = lambda percent: BOTTOM - (BOTTOM - TOP) * percent / most
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        'font-family="Helvetica, Arial, sans-serif" font-size="13" role="img" aria-labelledby="t d">',
        '  <title id="t">Slope of the correction against what stays</title>',
        '  <desc id="d">For six arms with Table 1 and several settings of steepest: the greatest slope found, and the share of poses '
        'with more than 0.02 mm left. The smaller the slope, the more stays.</desc>',
        f'  <rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#ffffff"/>',
        f'  <text x="{LEFT}" y="26" font-weight="bold" fill="#1b2433">poses with more than 0.02 mm left, %</text>',
    ]
    for percent in range(0, most + 1, 2):
        out.append(f'  <path d="M{LEFT},{y(percent):.1f} H{RIGHT}" stroke="{"#5b6b85" if percent == 0 else "#dde3ec"}"/>')
        out.append(f'  <text x="{LEFT - 8}" y="{y(percent) + 4.5:.1f}" text-anchor="end" fill="#3a465a">{percent}</text>')
    for slope in (2, 5, 10, 20, 50, 100, 200):
        if slope > high:
            continue
        out.append(f'  <path d="M{x(slope):.1f},{TOP} V{BOTTOM}" stroke="#dde3ec"/>')
        out.append(f'  <text x="{x(slope):.1f}" y="{BOTTOM + 20}" text-anchor="middle" fill="#3a465a">{slope}</text>')
    out.append(f'  <text x="{RIGHT}" y="{BOTTOM + 44}" text-anchor="end" font-weight="bold" fill="#1b2433">'
               'greatest slope found, change of the correction per change of the command</text>')
    for n, (arm, points) in enumerate(by_arm(rows).items()):
        points = sorted(points, key=lambda row: -row["steepest"])
        at = [(x(row["slope"]), y(row["position_percent"])) for row in points]
        colour = COLOURS[n % len(COLOURS)]
        out.append(f'  <polyline points="{" ".join(f"{a:.1f},{b:.1f}" for a, b in at)}" fill="none" stroke="{colour}" '
                   f'stroke-width="{2.5 if arm == "TX60L" else 1.5}"/>')
        for (a, b), row in zip(at, points):
            out.append(f'  <circle cx="{a:.1f}" cy="{b:.1f}" r="3.5" fill="{colour}"><title>{arm}, steepest {row["steepest"]}: slope '
                       f'{row["slope"]:g}, {row["position_percent"]:g} %</title></circle>')
            if arm == "TX60L":
                out.append(f'  <text x="{a + 5:.1f}" y="{b - 7:.1f}" font-size="11.5" fill="{colour}">'
                           f'{row["steepest"]}</text>')
        # The key.
        row = TOP + 20 + 22 * n
        out.append(f'  <path d="M{RIGHT + 16},{row} h22" stroke="{colour}" stroke-width="{2.5 if arm == "TX60L" else 1.5}"/>')
        out.append(f'  <text x="{RIGHT + 44}" y="{row + 4.5}" fill="#1b2433">{arm}</text>')
    out.append(f'  <text x="{RIGHT + 16}" y="{TOP + 20 + 22 * len(by_arm(rows)) + 14}" font-size="11.5" fill="#3a465a">numbers: steepest</text>')
    return "\n".join(out) + "\n</svg>\n"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
    import write_tables

    figures = write_tables.load()
    figures["slope_against_residual"] = {
        "about": f"Greatest slope found in {EVALUATIONS:,} evaluations, and shares of {POSES:,} random poses, Table 1. Written by "
                 "docs/pictures/slope_curve.py.",
        "rows": measure(sys.argv[1])}
    write_tables.save(figures)
    sys.exit(write_tables.main([]))
