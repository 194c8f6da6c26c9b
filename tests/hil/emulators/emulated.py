# SPDX-License-Identifier: Apache-2.0
"""What the tests of emulated controllers share: the bench that buses.py needs around a controller that runs already;
of the Cortex-M7 also its console, and a Modbus master of their own."""
import json
import os
import re
import select
import socket
import struct
import subprocess
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import buses  # noqa: E402
from buses import check, crc16  # noqa: E402

# How long something may take that takes milliseconds, on a machine that is busy with something else.
PATIENCE = 30.0


class Bench(buses.Bench):
    """A controller that somebody else has started, on one bus."""

    def __init__(self, work, bus, address):
        self.work = work
        self.buses = [bus]
        self.address = {bus: address}


class Console:
    """The controller's second serial line: one letter, one line of JSON (firmware/examples)."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(PATIENCE)
        self.socket.connect(os.environ["FLEXCOMP_CONSOLE"])
        self.lines = self.socket.makefile("r")

    def ask(self, letter="?"):
        self.socket.sendall(letter.encode())
        return json.loads(self.lines.readline())

    def wait(self, reached, what):
        """Asks until it is so, and returns the report."""
        end = time.monotonic() + PATIENCE
        while True:
            report = self.ask()
            if reached(report):
                return report
            check(time.monotonic() < end, f"waited for {what}", report)
            time.sleep(0.02)


def periods_left_out():
    """What the board of the Cortex-R5F counts, read from its memory by QEMU's monitor."""
    symbols = subprocess.run(["arm-none-eabi-nm", os.environ["FLEXCOMP_IMAGE"]], capture_output=True, text=True, check=True,
                             timeout=60).stdout
    address = re.search(r"^([0-9a-f]+) \w board_periods_left_out$", symbols, re.M).group(1)
    with socket.socket(socket.AF_UNIX) as monitor:
        monitor.settimeout(PATIENCE)
        monitor.connect(os.environ["FLEXCOMP_MONITOR"])
        monitor.sendall(f"xp /1dw 0x{address}\n".encode())
        said = b""
        while not (word := re.search(rb"\b0*%s:\s+(\d+)" % address.lstrip("0").encode(), said)):
            said += monitor.recv(4096)
    return int(word.group(1))


class Master:
    """A Modbus master that asks again as soon as it is answered, to load the line."""

    def __init__(self, unit):
        self.fd = os.open(os.environ["FLEXCOMP_DEVICE"], os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self.unit = unit
        self.bytes = 0
        self.answers = 0
        self.repeated = 0

    def close(self):
        os.close(self.fd)

    def ask(self, pdu, attempts=5):
        """The answer. A machine that is busy elsewhere may tear a frame by a pause in it; then it is asked again,
        after a silence that is longer than the gap of the line."""
        frame = bytes([self.unit]) + pdu
        frame += crc16(frame)
        for attempt in range(attempts):
            os.write(self.fd, frame)
            self.bytes += len(frame)
            answer, length = b"", 5
            end = time.monotonic() + PATIENCE / attempts
            while len(answer) < length and time.monotonic() < end:
                if select.select([self.fd], [], [], 1)[0]:
                    answer += os.read(self.fd, 512)
                if len(answer) >= 3 and not answer[1] & 0x80:
                    length = 5 + answer[2] if answer[1] in (3, 4, 0x17) else 8
            if answer:
                break
            self.repeated += 1
        check(len(answer) == length and answer[0] == self.unit and crc16(answer[:-2]) == answer[-2:],
              "the answer comes and is whole", pdu.hex(), answer.hex())
        self.bytes += length
        self.answers += 1
        return answer[1:-2]

    def read(self, address, count):
        answer = self.ask(struct.pack(">BHH", 3, address, count))
        check(answer[0] == 3, f"{count} registers from 0x{address:04x} can be read", answer.hex())
        return answer[2:]

    def write(self, address, data):
        """The exception code, 0 where there was none."""
        answer = self.ask(struct.pack(">BHHB", 16, address, len(data) // 2, len(data)) + data)
        return answer[1] if answer[0] & 0x80 else 0

    def read_window(self, offset, count):
        """Writes the reading offset and reads the window in one request."""
        answer = self.ask(struct.pack(">BHHHHBI", 0x17, 0x0202, count, 0x0200, 2, 4, offset))
        check(answer[0] == 0x17, "the active image can be read", answer.hex())
        return answer[2:]

    def command(self, number, argument=0):
        return self.write(0x00A0, struct.pack(">IH", argument, number))

    def status(self):
        fields = struct.unpack_from(">HHHHIHHIIII", self.read(0x0040, 48))
        names = ("state", "answer", "refusal", "faults", "detail", "slot", "settled", "sequence", "bytes", "crc",
                 "previous")
        return dict(zip(names, fields))
