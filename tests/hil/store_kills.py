# SPDX-License-Identifier: Apache-2.0
"""The file store of flexcomp-controller under SIGKILL: the controller is killed at random moments of pushes, pushes on trial, confirms,
rollbacks and restores. After each restart the active set is one of the two that it may be, byte for byte; the set that was told
to be active is; and a plain restart changes nothing.

    store_kills.py [KILLS [SEED]]     default 40 kills; the run of docs/buses.md has 500
"""
import os
import random
import sys
import tempfile
import threading
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from buses import CALIBRATION, check, read, write  # noqa: E402
from disturbed_buses import Bench  # noqa: E402

TRIAL = 4  # a state
# The client waits for the controller that is started again.
PATIENT = 5


class Killer(threading.Thread):
    """Kills the controller after a time of its own, or so long after the first change of its store, and starts it anew."""

    def __init__(self, bench, rng):
        super().__init__()
        self.bench, self.path = bench, f"{bench.work}/store.bin"
        self.at_change = rng.random() < 0.7
        # Erasing and writing some 1 KB takes some milliseconds.
        self.delay = rng.random() * (0.004 if self.at_change else 0.06)
        self.gone_for = rng.choice((0, 0, 0.2))
        self.left = None
        self.is_over = threading.Event()

    def run(self):
        if self.at_change:
            end = time.monotonic() + PATIENT
            first = os.stat(self.path).st_mtime_ns
            while os.stat(self.path).st_mtime_ns == first and time.monotonic() < end and not self.is_over.is_set():
                time.sleep(0.0001)
        time.sleep(self.delay)
        self.bench.close()
        self.left = read(self.path)
        time.sleep(self.gone_for)
        self.bench.start()


def one_kill(bench, k, held, counts):
    """held: sequence → image of every set that has run permanently."""
    rng, work = bench.rng, bench.work
    permanent, permanent_image = bench.judge()
    held[permanent["sequence"]] = permanent_image
    previous_image = held.get(permanent["previous"], b"")
    what = rng.choice(("push", "push", "trial", "confirm", "end trial", "rollback", "restore"))
    if what == "rollback" and permanent["previous"] == 0 or what == "restore" and permanent["sequence"] == 0:
        what = "push"
    sent = f"{work}/sent"
    if os.path.exists(sent):
        os.unlink(sent)
    write(f"{work}/cal.yaml", CALIBRATION.format(name="staubli-tx60l", a=-0.08 + 1e-5 * k))
    push = ["push", "--to", bench.clean, f"{work}/cal.yaml", "--image", sent]
    on_trial = [*push, "--trial", "100000"]
    if what in ("confirm", "end trial"):
        word, err = bench.flexcomp(*on_trial, timeout=PATIENT)
        check(word == "active", "a push on trial that nothing disturbs", err)
    arguments = {"push": push, "trial": on_trial, "confirm": ["push", "--to", bench.clean, "--confirm"],
                 "end trial": ["rollback", "--at", bench.clean], "rollback": ["rollback", "--at", bench.clean],
                 "restore": ["erase", "--at", bench.clean, "--yes"]}
    store_before = read(f"{work}/store.bin")
    killer = Killer(bench, rng)
    killer.start()
    word, _ = bench.flexcomp(*arguments[what], timeout=PATIENT)
    killer.is_over.set()
    killer.join()
    now, image = bench.judge()
    sent_image = read(sent) if os.path.exists(sent) else permanent_image
    # What runs where the command has taken effect; a restart ends a trial, so after one a rollback is that of the permanent set.
    after = {"push": [sent_image], "confirm": [sent_image], "trial": [permanent_image],
             "end trial": [permanent_image, previous_image], "rollback": [previous_image], "restore": [b""]}[what]
    on_trial_again = what == "trial" and now["state"] == TRIAL  # pushed to the controller that was started again
    if on_trial_again:
        after = [sent_image]
    whole = image == permanent_image or image in after
    durable = word != "active" or image in after
    # A plain restart.
    with bench.lock:
        bench.close()
        bench.start()
    again, image_again = bench.judge()
    stays = (again["sequence"], again["crc"], again["previous"], image_again) == (
        now["sequence"], now["crc"], now["previous"], image) and now["state"] == 0
    if on_trial_again:
        stays = image_again == permanent_image
    stays = stays and again["state"] == 0
    # The start mended what the kill had left, or what was begun is not there.
    cut = killer.left not in (store_before, read(f"{work}/store.bin"))
    cut = cut or (killer.left != store_before and image == permanent_image)
    counts["kills"] += 1
    counts["cut while writing"] += cut
    counts["set before"] += image == permanent_image
    counts["set after"] += image != permanent_image
    for name, fine in (("not whole", whole), ("active, but lost", durable), ("changed by a restart", stays)):
        if not fine:
            counts[name] += 1
            print(f"{k}: {what} ends {word}, {name}; before {permanent}, now {now}, again {again}", flush=True)


def main(kills=40, seed=16):
    counts = dict.fromkeys(("kills", "set before", "set after", "cut while writing", "not whole", "active, but lost",
                            "changed by a restart"), 0)
    held = {0: b""}
    with tempfile.TemporaryDirectory() as work:
        bench = Bench(work, "store kills", random.Random(int(seed)))
        try:
            for k in range(int(kills)):
                one_kill(bench, k, held, counts)
        finally:
            bench.close()
    print("| " + " | ".join(counts) + " |")
    print("| " + " | ".join(f"{counts[key]:{len(key)}}" for key in counts) + " |")
    failed = any(counts[key] for key in ("not whole", "active, but lost", "changed by a restart"))
    if counts["cut while writing"] < counts["kills"] / 20:
        print("too few kills fell into the writing")
        failed = True
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
