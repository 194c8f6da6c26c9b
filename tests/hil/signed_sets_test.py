#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Signed sets from end to end: flexcomp keygen, trust, push, rollback and erase against flexcomp-controller --trust."""
import json
import os
import socket
import struct
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from buses import CALIBRATION, check, modbus_request, read, write  # noqa: E402

ROOT, PROGRAMS = os.environ["FLEXCOMP_SOURCE_DIR"], os.environ["FLEXCOMP_BIN_DIR"]
STAGE, COMMAND = 0x0100, 0x00A0
BEGIN, VERIFY, COMMIT, ROLLBACK, RESTORE, UNLOCK = 1, 2, 3, 6, 8, 9


def flexcomp(*arguments, expect=0):
    run = subprocess.run([f"{PROGRAMS}/flexcomp", *arguments], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    check(run.returncode == expect, f"exit {expect} of flexcomp {' '.join(arguments)}", run.returncode, run.stdout + run.stderr)
    return run


class Controller:
    def __init__(self, work, robot, *trusted, store="store.bin"):
        keys = [part for key in trusted for part in ("--trust", key)]
        self.process = subprocess.Popen(
            [f"{PROGRAMS}/flexcomp-controller", "--robot", robot, "--store", f"{work}/{store}", "--modbus-tcp", "127.0.0.1:0", *keys],
            stdout=subprocess.PIPE, text=True)
        ready = self.process.stdout.readline()
        check(ready.startswith("ready "), "the controller starts", ready)
        address = next(word for word in ready.split() if word.startswith("modbus-tcp"))
        self.port = int(address.split(":")[-2] if address.count(":") > 1 else address.split(":")[-1])
        self.at = f"modbus-tcp:127.0.0.1:{self.port}"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()

    def status(self, work):
        flexcomp("status", "--of", self.at, "--quiet", "--json", f"{work}/status.json")
        return json.loads(read(f"{work}/status.json"))


class Master:
    """A foreign master that writes registers."""

    def __init__(self, port):
        self.sock = socket.create_connection(("127.0.0.1", port), 5)
        self.sock.settimeout(5)

    def write(self, address, payload):
        answer = modbus_request(self.sock, 255, struct.pack(">BHHB", 0x10, address, len(payload) // 2, len(payload)) + payload)
        return 0 if answer[0] == 0x10 else answer[1]

    def command(self, number, argument=0):
        return self.write(COMMAND, struct.pack(">IH", argument, number))

    def status(self):
        answer = modbus_request(self.sock, 255, struct.pack(">BHH", 3, 0x0040, 48))
        return dict(zip(("state", "answer", "refusal", "faults", "detail"), struct.unpack(">HHHHI", answer[2:14])))

    def offer(self, image):
        """A set, to verify and commit; the refusal, 0 where it is taken."""
        check(self.command(BEGIN, len(image)) == 0, "a transfer begins")
        for at in range(0, len(image), 240):
            part = image[at:at + 240]
            check(self.write(STAGE, struct.pack(">I", at) + part + b"\0" * (len(part) & 1)) == 0, "bytes are taken")
        self.command(COMMIT)
        while self.status()["state"] == 3:
            pass
        return self.status()["refusal"]


def main():
    with tempfile.TemporaryDirectory() as work:
        robot, other = f"{work}/arm.yaml", f"{work}/other.yaml"
        write(robot, read(f"{ROOT}/host/robots/tx60l.yaml").decode() + "serial: arm 5\n")
        write(other, read(f"{ROOT}/host/robots/tx60l.yaml").decode() + "serial: arm 6\n")
        for k in (1, 2, 3):
            write(f"{work}/cal{k}.yaml", CALIBRATION.format(name="staubli-tx60l", a=-0.08 - 0.01 * k))
        key, thief = f"{work}/arm.key", f"{work}/thief.key"
        flexcomp("keygen", "-o", key)
        flexcomp("keygen", "-o", thief)
        # A key without a unit, a private key where the public one is asked for: refused at the start.
        for wrong in (["--robot", f"{ROOT}/host/robots/tx60l.yaml", "--trust", key + ".pub"], ["--robot", robot, "--trust", key]):
            run = subprocess.run([f"{PROGRAMS}/flexcomp-controller", "--store", f"{work}/none", "--modbus-tcp", "127.0.0.1:0", *wrong],
                                 capture_output=True, text=True, timeout=20)
            check(run.returncode == 3, "refused at the start", run)

        with Controller(work, robot, key + ".pub") as controller:
            at = controller.at
            check("trusted" in flexcomp("trust", key + ".pub", "--at", at).stdout, "the key is trusted")
            run = flexcomp("push", "--to", at, "--robot", robot, f"{work}/cal1.yaml", expect=4)
            check("--key" in run.stderr, "an unsigned push says what to do", run.stderr)
            flexcomp("push", "--to", at, "--robot", robot, "--key", thief, f"{work}/cal1.yaml", expect=4)
            flexcomp("push", "--to", at, "--robot", other, "--key", key, f"{work}/cal1.yaml", expect=4)
            flexcomp("push", "--to", at, "--robot", robot, "--key", key, f"{work}/cal1.yaml", "--image", f"{work}/first")
            flexcomp("push", "--to", at, "--robot", robot, "--key", key, f"{work}/cal2.yaml", "--trial", "100000")
            flexcomp("push", "--to", at, "--confirm")
            flexcomp("push", "--to", at, "--robot", robot, "--key", key, "--resume", f"{work}/cal2.yaml")
            master = Master(controller.port)
            check(master.offer(read(f"{work}/first")) == 28, "what was recorded is refused by its counter")
            for command in (ROLLBACK, RESTORE):
                check(master.command(command) != 0 and master.status()["answer"] == 4, "a foreign master may not", command)
                check(master.command(UNLOCK) != 0 and master.status()["answer"] == 4, "nor unlock")
            flexcomp("rollback", "--at", at, expect=4)
            flexcomp("rollback", "--at", at, "--key", thief, expect=4)
            flexcomp("rollback", "--at", at, "--robot", other, "--key", key, expect=4)
            flexcomp("rollback", "--at", at, "--robot", robot, "--key", key)
            before = controller.status(work)

        with Controller(work, robot, key + ".pub") as controller:
            at = controller.at
            check(controller.status(work)["active"] == before["active"], "a restart changes nothing", before)
            check(Master(controller.port).offer(read(f"{work}/first")) == 28, "nor makes what was recorded new")
            flexcomp("push", "--to", at, "--robot", robot, "--key", key, f"{work}/cal3.yaml")
            flexcomp("erase", "--at", at, "--yes", expect=4)
            flexcomp("erase", "--at", at, "--yes", "--robot", robot, "--key", key)
            check(Master(controller.port).offer(read(f"{work}/first")) == 28, "nor does an erase of both slots")
            flexcomp("push", "--to", at, "--robot", robot, "--key", key, f"{work}/cal3.yaml")
        # Rotation: both keys, then the new one alone; the set that the old one signed does not run any more.
        new = f"{work}/new.key"
        flexcomp("keygen", "-o", new)
        with Controller(work, robot, key + ".pub", new + ".pub") as controller:
            check(controller.status(work)["active"]["sequence"] != 0, "both keys count")
        with Controller(work, robot, new + ".pub") as controller:
            check(controller.status(work)["active"]["sequence"] == 0, "the old one no longer does")
            flexcomp("push", "--to", controller.at, "--robot", robot, "--key", key, f"{work}/cal1.yaml", expect=4)
            flexcomp("push", "--to", controller.at, "--robot", robot, "--key", new, f"{work}/cal1.yaml")
        # Without a key: bound to the unit, and nothing is destroyed without an unlock.
        with Controller(work, robot, store="free.bin") as controller:
            at = controller.at
            flexcomp("push", "--to", at, "--robot", other, f"{work}/cal1.yaml", expect=4)
            flexcomp("push", "--to", at, "--robot", robot, f"{work}/cal1.yaml")
            flexcomp("push", "--to", at, "--robot", robot, f"{work}/cal2.yaml")
            flexcomp("push", "--to", at, "--robot", robot, "--key", key, f"{work}/cal3.yaml")  # a signature does no harm
            master = Master(controller.port)
            check(master.command(ROLLBACK) != 0 and master.status()["answer"] == 4, "not unlocked")
            flexcomp("rollback", "--at", at)
            flexcomp("erase", "--at", at, expect=2)
            flexcomp("erase", "--at", at, "--yes")
            check(controller.status(work)["active"]["sequence"] == 0, "erased")
    print("ok")


main()
