# SPDX-License-Identifier: Apache-2.0
"""The control cycle is never disturbed: counted instructions of each step, its rhythm, and the commands' smoothness,
with an idle bus and under full load.

    cortex_m7_cycle.py WORK SHIFT SET     inside hil/emulators/cortex-m7-modbus --shift SHIFT; SET is one of SETS

The image measures itself (firmware/examples/cycle_monitor.h). One instruction takes 2^SHIFT ns of the controller's
time, so its 25 MHz counter counts instructions.
"""
import os
import random
import struct
import sys

from emulated import Console, Master

import buses
from buses import check, flexcomp, passed, read, spoiled_images, with_crc, write

UNIT = 1
TICK_NS = 40
CYCLE_TICKS = 25000
PATH_CYCLES = 1000
STATES = ("no_set", "settling", "active", "settling_out")
ENOUGH_CYCLES = 900
SETTLING = 32  # the flag
# What a change of set may add to a joint's command in a cycle of 1 ms: the image sets 3 mrad/s.
OFFSET_NRAD = 3000
# Of sensitivity_of() for such a set (firmware/src/control.cpp), in the cycle that takes it over.
SENSITIVITY_INSTRUCTIONS = 700
# As `identify` makes a set (geometry, compliance, gravity), and with eleven kinds of effect, also such as move more than
# the joints: the step goes different ways for them.
SETS = {
    "identified": buses.CALIBRATION[:buses.CALIBRATION.index("  - {{effect: gear_harmonic")],
    "many-effects": buses.CALIBRATION,
}
VERIFY, COMMIT, ROLLBACK, ABORT, RESTORE, UNLOCK = 2, 3, 6, 7, 8, 9


class Controller:
    """The controller on its two lines: what is asked of its bus, and what its monitor says."""

    def __init__(self, work, calibration_text):
        self.console = Console()
        self.master = Master(UNIT)
        self.images = []
        bus = os.environ["FLEXCOMP_BUS"]
        for number in (1, 2):
            calibration = f"{work}/{number}.yaml"
            write(calibration, calibration_text.format(name="staubli-tx60l", a=-0.05 * number))
            flexcomp("push", "--to", bus, calibration, "--image", f"{work}/{number}")
            self.images.append(read(f"{work}/{number}"))
        self.sequence = 2
        # What is refused in every state; without a set no sequence is too old.
        self.refused = [image for what, (image, _) in spoiled_images(self.images[0]).items()
                        if what != "of an old sequence"]
        self.random = random.Random(2019)

    def stage(self, image):
        check(self.master.command(1, len(image)) == 0, "a transfer begins")
        for at in range(0, len(image), 242):
            part = image[at:at + 242]
            check(self.master.write(0x0100, struct.pack(">I", at) + part + b"\0" * (len(part) & 1)) == 0, "bytes are taken")

    def settle(self):
        """Until the store has done what it was told, with a question after each answer."""
        while True:
            status = self.master.status()
            if status["state"] == 0:
                return status

    def push(self, which):
        self.sequence += 1
        image = self.images[which]
        self.stage(with_crc(image[:12] + struct.pack("<I", self.sequence) + image[16:]))
        check(self.master.command(VERIFY) == 0, "a good image is verified")
        check(self.master.command(COMMIT) == 0, "and committed")
        status = self.settle()
        check(status["sequence"] == self.sequence and status["answer"] == 0, "and active", status)

    def push_refused(self):
        self.stage(self.random.choice(self.refused))
        check(self.master.command(VERIFY) == 0, "the check of a spoiled image begins")
        status = self.settle()
        check(status["answer"] == 1, "and it is refused", status)

    def run(self, command):
        if command in (ROLLBACK, RESTORE):
            check(self.master.command(UNLOCK) == 0, "an unlock is asked for")
            check(self.master.command(UNLOCK, self.master.status()["detail"]) == 0, "and answered")
        check(self.master.command(command) == 0, f"command {command}")
        status = self.settle()
        check(status["answer"] == 0, f"command {command} is carried out", status)

    def load(self):
        """A little of everything that a client may ask, without a pause."""
        kind = self.random.randrange(8)
        if kind == 0:
            self.push_refused()
        elif kind == 1:
            self.stage(self.images[0])
            check(self.master.command(ABORT) == 0, "a transfer is dropped")
        elif kind == 2:
            status = self.master.status()
            if status["sequence"] != 0:
                image = b"".join(self.master.read_window(at, min(123, (status["bytes"] - at) // 2))
                                 for at in range(0, status["bytes"], 246))
                check(len(image) == status["bytes"], "the active image can be read while all this goes on")
        elif kind == 3:
            request = struct.pack(">6d", 0.1, -0.2, 1.3, 0.2, 0.8, 0.1) + bytes(216 - 48)
            check(self.master.write(0x0300, request) == 0, "a probe is taken")
            check(self.master.write(0x036C, b"\0\2") == 0, "and answered")
            self.master.read(0x0380, 36)
        else:
            self.master.read(0x0500, 125)

    def load_until(self, reached, what):
        for _ in range(10000):
            for _ in range(10):
                self.load()
            report = self.console.ask()
            if reached(report):
                return report
        check(False, f"under load: {what}", report)

    def silent_until(self, reached, what):
        return self.console.wait(reached, what)


def cycles(report, state, load):
    return report[state][load]["cycles"]


def phase(c, load, until):
    """Every state, with and without a set over the whole path or nearly so, changes as often as that takes: on a machine that is busy
    elsewhere the bus is silent at times that were meant to be loaded."""
    def reached(state, paths):
        return lambda r: cycles(r, state, load) >= paths * PATH_CYCLES

    before, sent = c.console.ask(), c.master.bytes
    until(reached("no_set", 2), f"no set, {load}")
    paths = 0
    for _ in range(20):
        for which in (0, 1):
            c.push(which)
            paths += 1
            report = until(reached("active", paths), f"a set, {load}")
        if load == "loaded":
            c.run(ROLLBACK)
            paths += 1
            report = until(reached("active", paths), f"rolled back, {load}")
        c.run(RESTORE)
        report = until(reached("no_set", 2 + paths), f"settled, {load}")
        if all(cycles(report, state, load) >= ENOUGH_CYCLES for state in STATES):
            return report, (c.master.bytes - sent) / (report["cycles"] - before["cycles"])
    check(False, f"enough cycles of each state, {load}", report)


def undisturbed(report, shift):
    instructions = TICK_NS / 2 ** shift
    most = 0
    print("instructions of flexcomp_step    idle bus          bus under load    cycles idle, loaded")
    for state in STATES + ("changing",):
        idle, loaded = report[state]["idle"], report[state]["loaded"]
        (a, b), (x, y) = idle["step_ticks"], loaded["step_ticks"]
        print("  %-12s             %8.0f … %-8.0f %8.0f … %-8.0f %6d, %d" % (
            state, a * instructions, b * instructions, x * instructions, y * instructions, idle["cycles"], loaded["cycles"]))
        if state == "changing":
            # Taking a set over costs some instructions once, with the bound of its sensitivity to the load some 300, and
            # the bus has always just been heard: no more than the largest of the rest with that margin.
            check(loaded["cycles"] >= 6 and y <= 1.01 * most + 1 + SENSITIVITY_INSTRUCTIONS / instructions,
                  "nor where the set changes hands", y, most)
            continue
        most = max(most, b)
        # One tick is what the counter cannot tell. Without a set the work is mostly that of the offset's return, whose
        # branches (some 20 instructions of 1,150) differ from change to change.
        margin = 0.03 if state == "settling_out" else 0.01
        for quiet, busy in ((a, x), (b, y)):
            check(abs(busy - quiet) <= margin * quiet + 1, f"{state}: as with an idle bus", quiet, busy)
    passed("the instruction count of the step under load is within 1 % of that with an idle bus; 3 % while a set settles out")

    check(report["late"] == 0, "no cycle is late", report["late"])
    check(all(abs(t - CYCLE_TICKS) <= CYCLE_TICKS // 100 for t in report["interval_ticks"]), "nor does one begin late",
          report["interval_ticks"])
    passed(f"none of {report['cycles']} cycles is late; they begin {report['interval_ticks']} ticks of 40 ns after each other")

    # While the arm moves its correction changes by itself; a change of set may add what the offset's rate allows.
    for state in ("settling", "settling_out"):
        for j in range(6):
            path = max(report[s]["change_moving_nrad"][j] for s in ("active", "no_set"))
            change = report[state]["change_moving_nrad"][j]
            check(change <= path + OFFSET_NRAD + 2, f"{state}: joint {j + 1} does not jump on the move", change, path)
    passed("on the move no command jumps by more than the path and the offset's rate make it")


def no_jump(c):
    """With a command that stands still, every change of the corrected command is the change of set."""
    c.console.ask("s")
    # What the last restore on the move left may still be on its way to 0.
    c.load_until(lambda r: r["flags"] & SETTLING == 0, "at rest")
    steps = (("a first set", lambda: c.push(0)), ("another set", lambda: c.push(1)), ("rollback", lambda: c.run(ROLLBACK)),
             ("another set again", lambda: c.push(1)), ("restore defaults", lambda: c.run(RESTORE)))
    for what, change in steps:
        c.console.ask("0")
        before = c.load_until(lambda r: r["cycles"] > 50, "standing still")
        check(not any(v for s in STATES for v in before[s]["change_standing_nrad"]), "nothing moves before", before)
        change()
        # The offset moves by now, at the latest.
        over = c.console.ask()["cycles"] + 20
        after = c.load_until(lambda r: r["cycles"] > over and r["flags"] & SETTLING == 0, what)
        worst, fastest = 0.0, 0
        for j in range(6):
            apart = abs(after["correction_nrad"][j] - before["correction_nrad"][j])
            largest = max(after[s]["change_standing_nrad"][j] for s in STATES + ("changing",))
            # Angles are told in whole nrad.
            check(largest <= OFFSET_NRAD + 2, f"{what}: joint {j + 1} does not jump", largest)
            worst, fastest = max(worst, apart), max(fastest, largest)
        check(worst > 100000, f"{what}: there is something to settle", worst)
        check(fastest >= 0.99 * OFFSET_NRAD - 2, f"{what}: and moves as fast as it may", fastest)
        passed(f"{what}: corrections move by up to {worst * 1e-6:.3f} mrad, in any cycle by at most {fastest * 1e-6:.3f}")
    c.console.ask("m")


def main(work, shift, kind):
    print(f"--- sets of the kind '{kind}'")
    c = Controller(work, SETS[kind])
    c.console.ask("a")
    c.run(RESTORE)
    start = c.console.ask()["cycles"]
    c.silent_until(lambda r: r["cycles"] > start + 20 and r["flags"] & SETTLING == 0, "the change of set has settled")
    c.console.ask("0")
    phase(c, "idle", c.silent_until)
    report, rate = phase(c, "loaded", c.load_until)
    print(f"under load {rate:.1f} bytes a cycle on the bus, {c.master.answers} answers in all, "
          f"{c.master.repeated} requests repeated; "
          "a full line of 115200 baud carries 11.5")
    undisturbed(report, shift)
    no_jump(c)
    passed("all of it")


main(sys.argv[1], int(sys.argv[2]), sys.argv[3])
