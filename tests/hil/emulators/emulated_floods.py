# SPDX-License-Identifier: Apache-2.0
"""Floods on the bus of an emulated controller: no control cycle is left out, a push ends in a word that is true, within 2 s of
the end the controller answers, and the first push gets through. The controller's memory is static.

    emulated_floods.py m7|r5f [--seconds S] [--pushes N]     inside hil/emulators/...
"""
import argparse
import json
import os
import tempfile
import time

from emulated import Console, periods_left_out

import buses
import floods
from buses import check, flexcomp, passed, read

BUS = os.environ["FLEXCOMP_BUS"]
HEADER = ("| flood | sent/s | cycles | left out | active | refused | open | untrue | not whole | longest push s | answers after s | then a push, s |\n"
          "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|")


class Board:
    def __init__(self, work):
        self.work = work

    def flexcomp(self, *arguments, timeout):
        """The word and the reason."""
        told = f"{self.work}/told.json"
        said = buses.flexcomp(*arguments, "--timeout", timeout, "--json", told, "--quiet", expect=None)
        word = {0: "active", 4: "refused", 5: "open"}.get(said.status, f"exit {said.status}")
        check(json.loads(read(told, "r"))["outcome"] == word, "word and exit status agree", said)
        return word, said.err

    def active_image(self):
        flexcomp("pull", "--from", BUS, "--image", f"{self.work}/held", "--timeout", 5, "--quiet")
        return read(f"{self.work}/held")


class M7(Board):
    """Counts late cycles itself, on its second line."""

    def __init__(self, work):
        super().__init__(work)
        self.console = Console()
        # Its time is then that of its instructions alone.
        self.console.ask("a")
        fd = os.open(os.environ["FLEXCOMP_DEVICE"], os.O_RDWR | os.O_NOCTTY)
        self.floods = {"noise, a full line": floods.rtu_noise([fd]), "noise, ten bursts/s": floods.rtu_bursts([fd]),
                       "requests of another master": floods.rtu_requests(fd, 1)}

    def cycles(self):
        report = self.console.ask()
        return report["cycles"], report["late"]


class R5f(Board):
    """The board counts the periods of which it began no cycle."""

    def __init__(self, work):
        super().__init__(work)
        self.floods = {name: floods.can_flood(name, node=1) for name in floods.CAN_FLOODS}

    def cycles(self):
        flexcomp("status", "--of", BUS, "--json", f"{self.work}/status.json", "--timeout", 5, "--quiet")
        return json.loads(read(f"{self.work}/status.json", "r"))["cycles"], periods_left_out()


def flood(board, name, seconds, pushes):
    words = floods.Words()
    before_image = board.active_image()
    before = board.cycles()
    with floods.Flooded([board.floods[name]]) as flooding:
        time.sleep(0.5)
        begin, sent_before, pushed = time.monotonic(), flooding.sent(), []
        for _ in range(pushes):
            start = time.monotonic()
            pushed.append(floods.push(board.flexcomp, board, BUS))
            words.longest = max(words.longest, time.monotonic() - start)
        time.sleep(max(0.0, seconds - (time.monotonic() - begin)))
        sent = (flooding.sent() - sent_before) / (time.monotonic() - begin)
    ended = time.monotonic()
    # Answers to the flood may still be on the line.
    while flexcomp("status", "--of", BUS, "--timeout", 1, "--quiet", expect=None).status != 0:
        check(time.monotonic() - ended < floods.NORMAL_WITHIN_S, "the controller answers")
    answered = time.monotonic() - ended
    after = board.cycles()
    # There is no other bus to judge by: once the flood is over, by what runs then.
    now = board.active_image()
    active = [image for word, _, image in pushed if word == "active"]
    possible = [before_image, *active[-1:], *(image for word, _, image in pushed if word == "open")]
    for k, (word, why, image) in enumerate(pushed):
        words[word] = words.get(word, 0) + 1
        if os.environ.get("FLEXCOMP_REASONS"):
            print(f"  {word}: {why.strip()}", flush=True)
        refused_runs = word == "refused" and image is not None and image == now
        active_does_not = word == "active" and all(w == "refused" for w, _, _ in pushed[k + 1:]) and image != now
        words.untrue += refused_runs or active_does_not
    words.not_whole += now not in possible
    begun, done = floods.normal_again(board.flexcomp, board, BUS, time.monotonic())
    cycles, left_out = (b - a for a, b in zip(before, after))
    print(f"| {name} | {sent:.0f} | {cycles} | {left_out} | {words.row()} | {answered:.2f} | {done:.2f} |", flush=True)
    check(not words.wrong(), "every word is true, every set whole", words, [w[:2] for w in pushed])
    check(cycles > 100 and left_out == 0, "no cycle is left out", cycles, left_out)
    check(answered < floods.NORMAL_WITHIN_S and begun < 0.1, "answered in time, and the first push gets through", answered, begun)


def main():
    wanted = argparse.ArgumentParser()
    wanted.add_argument("board", choices=("m7", "r5f"))
    wanted.add_argument("--seconds", type=float, default=3)
    wanted.add_argument("--pushes", type=int, default=1)
    wanted.add_argument("floods", nargs="*")
    wanted = wanted.parse_args()
    with tempfile.TemporaryDirectory() as work:
        board = {"m7": M7, "r5f": R5f}[wanted.board](work)
        word, why, _ = floods.push(board.flexcomp, board, BUS, timeout=10)
        check(word == "active", "a push that nothing disturbs", why)
        print(HEADER, flush=True)
        for name in board.floods:
            if not wanted.floods or name in wanted.floods:
                flood(board, name, wanted.seconds, wanted.pushes)
    passed("all of it")


if __name__ == "__main__":
    main()
