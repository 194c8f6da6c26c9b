# SPDX-License-Identifier: Apache-2.0
"""Stops the emulated controller's arm at some poses of its path; what its control cycle was told and what it gives
to the drives there, as two files of joint angles.

    cortex_m7_stand_still.py COMMANDS.csv CORRECTED.csv      inside hil/emulators/cortex-m7-modbus
"""
import math
import sys

from emulated import Console, check

POSES = 8


def later(console, cycles):
    until = console.ask()["cycles"] + cycles
    return console.wait(lambda r: r["cycles"] >= until, f"{cycles} cycles")


def main(files):
    console = Console()
    later(console, 20)
    console.wait(lambda r: r["flags"] & 32 == 0, "the set that was pushed a moment ago has settled")
    rows = []
    while len(rows) < POSES:
        console.ask("m")
        later(console, 137)
        console.ask("s")
        report = later(console, 20)
        command, correction = report["command_nrad"], report["correction_nrad"]
        check(any(correction), "the cycle corrects", report)
        if not any(row[0] == command for row in rows):
            rows.append((command, [q + d for q, d in zip(command, correction)]))
    console.ask("m")
    header = ",".join(f"q{j}_deg" for j in range(1, 7))
    for k, path in enumerate(files):
        with open(path, "w") as file:
            print(header, *(",".join(repr(math.degrees(q * 1e-9)) for q in row[k]) for row in rows), sep="\n", file=file)


main(sys.argv[1:])
