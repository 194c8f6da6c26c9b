# SPDX-License-Identifier: Apache-2.0
"""Pushes over CAN interfaces of the kernel: the client on vcan0, the controller on vcan1, and between them a relay that loses and
doubles frames, with a master that polls 1001h on the controller's side. Run inside hil/with-vcan.

    disturbed_vcan.py PUSHES_PER_CHANNEL
"""
import json
import os
import random
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from buses import CALIBRATION, CONTROLLER, FLEXCOMP, NODE, SOURCE, check, read, write  # noqa: E402

CHANNELS = [("undisturbed", 0, 0, 0), ("loss 0.2 %", 0.002, 0, 0), ("1 % doubled", 0, 0.01, 0), ("poll 10 /s", 0, 0, 0.1),
            ("all three, 500 foreign frames/s", 0.002, 0.01, 0.1)]


class Relay:
    def __init__(self, rng):
        self.rng, self.lost, self.doubled, self.poll, self.load = rng, 0, 0, 0, False
        self.ends = []
        for interface in ("vcan0", "vcan1"):
            end = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
            end.bind((interface,))
            self.ends.append(end)
        for source, sink in (self.ends, self.ends[::-1]):
            threading.Thread(target=self.carry, args=(source, sink), daemon=True).start()
        threading.Thread(target=self.disturb, daemon=True).start()

    def carry(self, source, sink):
        while True:
            frame = source.recv(16)
            if self.rng.random() < self.lost:
                continue
            sink.send(frame)
            if self.rng.random() < self.doubled:
                sink.send(frame)

    def disturb(self):
        other = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        other.bind(("vcan1",))
        other.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b"")
        at = 0.0
        while True:
            time.sleep(0.01)
            if self.poll and time.monotonic() - at >= self.poll:
                at = time.monotonic()
                other.send(struct.pack("<IB3x8s", 0x600 + NODE, 8, bytes([0x40, 0x01, 0x10, 0, 0, 0, 0, 0])))
            for _ in range(5 if self.load else 0):
                other.send(struct.pack("<IB3x8s", 0x123, 8, bytes(8)))


def main(pushes):
    subprocess.run("ip link add dev vcan1 type vcan && ip link set vcan1 up", shell=True, check=True)
    relay = Relay(random.Random(16))
    print("| channel | pushes | active | refused | open | untrue | mean s |")
    with tempfile.TemporaryDirectory() as work:
        controller = subprocess.Popen([CONTROLLER, "--robot", f"{SOURCE}/host/robots/tx60l.yaml", "--store", f"{work}/store",
                                       "--can", f"vcan1:{NODE}"], stdout=subprocess.PIPE, text=True)
        check(controller.stdout.readline().startswith("ready "), "the controller starts")
        for name, lost, doubled, poll in CHANNELS:
            counts, seconds, untrue = {0: 0, 4: 0, 5: 0}, 0.0, 0
            for k in range(pushes):
                relay.lost, relay.doubled, relay.poll, relay.load = lost, doubled, poll, "foreign" in name
                write(f"{work}/cal.yaml", CALIBRATION.format(name="staubli-tx60l", a=-0.08 + 1e-4 * k))
                start = time.monotonic()
                pushed = subprocess.run([FLEXCOMP, "push", "--to", f"can:vcan0:{NODE}", f"{work}/cal.yaml", "--image",
                                         f"{work}/sent", "--json", f"{work}/told", "--quiet"], capture_output=True, text=True)
                seconds += time.monotonic() - start
                relay.lost = relay.doubled = relay.poll = 0
                relay.load = False
                told = json.loads(read(f"{work}/told"))
                check({"active": 0, "refused": 4, "open": 5}[told["outcome"]] == pushed.returncode, "word and exit status", told)
                counts[pushed.returncode] += 1
                subprocess.run([FLEXCOMP, "pull", "--from", f"can:vcan1:{NODE}", "--image", f"{work}/held", "--quiet"], check=True)
                runs = read(f"{work}/held") == read(f"{work}/sent")
                if pushed.returncode in (0, 4) and runs != (pushed.returncode == 0):
                    untrue += 1
                if pushed.returncode != 0:
                    print("  ", pushed.stderr)
            print(f"| {name} | {pushes} | {counts[0]} | {counts[4]} | {counts[5]} | {untrue} | {seconds / pushes:.2f} |", flush=True)
            check(untrue == 0 and counts[0] >= pushes * 0.99, "every push gets through, and what it says is true")
        controller.kill()
        controller.wait()


if __name__ == "__main__":
    main(int(sys.argv[1]))
