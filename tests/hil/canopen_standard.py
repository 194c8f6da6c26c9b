# SPDX-License-Identifier: Apache-2.0
"""The CANopen node of flexcomp-controller against CiA 301 and 306 on a CAN interface of the kernel, by python-can
(docs/canopen.md).

    canopen_standard.py prepare WORK         exports the data sheet and holds it against the rules of CiA 306 (eds_rules.py)
    canopen_standard.py run WORK [SECTIONS]  all others
"""
import os
import signal
import struct
import subprocess
import sys
import threading
import time

import eds_rules
from buses import (CALIBRATION, CONTROLLER, FLEXCOMP, NODE, SLACK, SOURCE, HandMadeSdo, check, flexcomp, passed, read, write)

OWN_REQUEST, OWN_ANSWER = 0x67F + NODE, 0x6AF + NODE
OFF = 0x80000000
NO_OBJECT, NO_SUB, READ_ONLY, WRITE_ONLY = 0x06020000, 0x06090011, 0x06010002, 0x06010001
TOO_LONG, TOO_SHORT, NO_DATA, NOT_STORED, VALUE = 0x06070012, 0x06070013, 0x08000024, 0x08000020, 0x06090030
LOCAL_CONTROL = 0x08000021
START, STOP, PRE_OPERATIONAL, RESET = 1, 2, 128, 130


def unlock(sdo):
    """What a master does before it erases."""
    for argument in (0, None):
        argument = sdo.number(0x2002, 6) if argument is None else argument
        check(sdo.download(0x2011, 1, struct.pack("<I", argument)) == 0, "an argument is taken")
        check(sdo.download(0x2011, 2, struct.pack("<H", 9)) == 0, "an unlock is taken")


def prepare(work):
    sheet = f"{work}/flexcomp.eds"
    flexcomp("export", "--as", "eds", "-o", sheet)
    data = read(sheet)
    faults = eds_rules.broken(data)
    check(not faults, "the data sheet breaks no rule of CiA 306", *faults)
    count = 0
    for what, spoiled in eds_rules.spoiled(data):
        check(spoiled != data and eds_rules.broken(spoiled), "a data sheet with a fault breaks a rule", what)
        count += 1
    flexcomp("export", "--as", "eds", "-o", sheet)
    check(read(sheet) == data, "the same version gives the same bytes")
    passed(f"[rules] the data sheet keeps {len(eds_rules.RULES)} groups of rules of CiA 306, {count} spoiled ones do not")
    robot = read(f"{SOURCE}/host/robots/tx60l.yaml", "r")
    write(f"{work}/robot.yaml", robot)
    name = next(line.split()[1] for line in robot.splitlines() if line.startswith("name:"))
    write(f"{work}/twin.yaml", robot.replace(f"name: {name}", "name: twin", 1))
    write(f"{work}/cal.yaml", CALIBRATION.format(name=name, a=-0.08))


class Sdo(HandMadeSdo):
    """Uploads and downloads that end in an abort code, as the standard has them."""

    @staticmethod
    def head(command, index, sub, data=bytes(4)):
        return bytes([command, index & 0xFF, index >> 8, sub]) + data

    def code(self, request):
        answer = self.ask(request)
        return struct.unpack("<I", answer[4:])[0] if answer[0] == 0x80 else 0

    def upload_code(self, index, sub):
        """0 where it can be read; a transfer of segments is left."""
        code = self.code(self.head(0x40, index, sub))
        if code == 0:
            self.send(self.head(0x80, index, sub))
        return code

    def download(self, index, sub, data, sized=True):
        """Expedited up to 4 bytes, else in segments; the abort code."""
        if len(data) <= 4:
            command = 0x23 | (4 - len(data)) << 2 if sized else 0x22
            return self.code(self.head(command, index, sub, data.ljust(4, b"\0")))
        return self.download_segments(index, sub, data)

    def download_segments(self, index, sub, data):
        code = self.code(self.head(0x21, index, sub, struct.pack("<I", len(data))))
        for k in range(0, len(data), 7):
            if code:
                break
            piece = data[k:k + 7]
            first = (k // 7 & 1) << 4 | 7 - len(piece) << 1 | (k + 7 >= len(data))
            code = self.code(bytes([first]) + piece.ljust(7, b"\0"))
        return code

    def number(self, index, sub=0):
        return int.from_bytes(self.upload(index, sub), "little")

    def put(self, index, sub, value, size):
        code = self.download(index, sub, value.to_bytes(size, "little"))
        check(code == 0, f"{index:04X}h:{sub} is set to {value:#x}", hex(code))


class Bench:
    """A controller and this program's ends of the bus."""

    def __init__(self, work, channel="", robot="robot.yaml", store="store.bin", node=NODE):
        import can
        self.arguments = ["--robot", f"{work}/{robot}", "--store", f"{work}/{store}", "--can", f"vcan0:{node}{channel}",
                          "--heartbeat-ms", "100"]
        self.store = f"{work}/{store}"
        self.bus = can.interface.Bus("vcan0", interface="socketcan")
        self.sdo = Sdo(self.bus)

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.kill()
        self.bus.shutdown()
        for path in (self.store, self.store + ".can"):
            if os.path.exists(path):
                os.remove(path)

    def start(self):
        self.process = subprocess.Popen([CONTROLLER, *self.arguments], stdout=subprocess.PIPE, text=True)
        ready = self.process.stdout.readline()
        check(ready.startswith("ready "), "the controller starts", ready)
        self.heartbeat()

    def kill(self):
        self.process.kill()
        self.process.wait()

    def nmt(self, command, node=NODE):
        import can
        self.bus.send(can.Message(arbitration_id=0, data=[command, node], is_extended_id=False))

    def listen_to(self, *identifiers):
        """From now on; a push would fill the socket's buffer meanwhile."""
        self.bus.set_filters([{"can_id": i, "can_mask": 0x7FF, "extended": False} for i in identifiers])

    def frames(self, identifier, seconds):
        """What comes with this identifier within a time: (s since the first call, bytes)."""
        out = []
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            message = self.bus.recv(left)
            if message is not None and message.arbitration_id == identifier:
                out.append((message.timestamp, bytes(message.data)))
        return out

    def heartbeat(self, state=127):
        """Waits for a heartbeat with this state; boot-up messages are none."""
        end = time.monotonic() + SLACK
        while time.monotonic() < end:
            message = self.bus.recv(0.5)
            if message is not None and message.arbitration_id == 0x700 + NODE and message.data[0] == state:
                return
        check(False, f"a heartbeat with state {state}")


def entries(work):
    """Every entry is read and written as the data sheet says: access, type, size, default value."""
    sheet = eds_rules.Sheet(read(f"{work}/flexcomp.eds"))
    signature = {0x1010: b"save", 0x1011: b"load"}
    refusable = {(0x1010, 1), (0x2010, 2)}  # nothing staged; no active set
    read_count = write_count = 0
    with Bench(work) as bench:
        sdo = bench.sdo
        sdo.put(0x1003, 0, 0, 1)  # a fresh store has the fault that there is no set
        for index, sub, keys in sheet.objects():
            at, access, kind = f"{index:04X}h:{sub or 0}", keys["AccessType"], eds_rules.number(keys["DataType"])
            sub = sub or 0
            size = eds_rules.TYPES.get(kind)
            code = sdo.upload_code(index, sub)
            value = None
            if access == "wo":
                check(code == WRITE_ONLY, f"{at} is write-only", hex(code))
            elif code == NO_DATA:
                check(index == 0x1003 or (index, sub) in refusable, f"{at} has no data", hex(code))
            else:
                check(code == 0, f"{at} is {access} and can be read", hex(code))
                value = sdo.upload(index, sub)
                check(size is None or len(value) == size, f"{at} has the size of its type", value.hex())
                expected = eds_rules.default(keys, NODE)
                if kind == eds_rules.TEXT:
                    check(expected is None or value.decode("ascii") == expected, f"{at} is visible text", value)
                elif expected is not None:
                    check(int.from_bytes(value, "little") == expected, f"{at} has its default value", value.hex())
                check(sdo.upload_block(index, sub, [7, 3]) == value or access != "const", f"{at} in blocks")
            read_count += 1
            if access in ("ro", "const"):
                for data in (value or bytes(size or 4), bytes(1), bytes(9)):
                    check(sdo.download(index, sub, data) == READ_ONLY, f"{at} cannot be written")
                write_count += 1
                continue
            if size is not None:
                for wrong in {size - 1, size + 1} & {1, 2, 3, 5}:
                    code = sdo.download(index, sub, bytes(wrong))
                    check(code == (TOO_LONG if wrong > size else TOO_SHORT), f"{at} with {wrong} bytes", hex(code))
                data = signature.get(index, value)
                for write_it in (sdo.download, sdo.download_segments, lambda *a: sdo.download(*a, sized=False)):
                    if (index, sub) == (0x1011, 1):
                        check(sdo.download(index, sub, data) == LOCAL_CONTROL, "one frame erases nothing")
                        unlock(sdo)
                    code = write_it(index, sub, data)
                    while sdo.number(0x2002, 1) == 3:  # working
                        time.sleep(0.01)
                    check(code == 0 or (index, sub) in refusable, f"{at} can be written", hex(code))
                if index in signature:
                    check(sdo.download(index, sub, b"evas") == NOT_STORED, f"{at} without its signature")
                elif value is not None:
                    check(sdo.upload(index, sub) == value, f"{at} reads what was written")
            elif value is not None:
                check(sdo.download(index, sub, value) == 0 and sdo.upload(index, sub) == value, f"{at} as a record")
                check(sdo.download(index, sub, value + b"x") == TOO_LONG, f"{at} with a byte too many")
            else:
                check(sdo.download(index, sub, b"rubbish in staging") == 0, f"{at} takes any bytes")
                check(sdo.download(0x2011, 2, struct.pack("<H", 7)) == 0, "and drops them")
            write_count += 1
        known = {name for name in sheet.sections}
        for name in sorted(n for n in known if len(n) == 4):
            index = int(name, 16)
            for sub in range(256):
                if f"{name}sub{sub:X}" not in known and (sub or "SubNumber" in sheet.sections[name]):
                    check(sdo.upload_code(index, sub) == NO_SUB, f"{name}h:{sub} is not there")
                    if sub > 12:
                        break
        for index in (0x1002, 0x1005, 0x1006, 0x1012, 0x1016, 0x1202, 0x1280, 0x1400, 0x1801, 0x1A01, 0x1FFF, 0x5FFF, 0x6000):
            if f"{index:04X}" not in known:
                check(sdo.upload_code(index, 0) == NO_OBJECT, f"{index:04X}h is not there")
    passed(f"[entries] {read_count} entries are read, {write_count} are written or refused as the data sheet says")


def channel(work):
    """A master reads the robot over 1200h without a pause while flexcomp pushes and pulls over 1201h."""
    with Bench(work, ":own") as bench:
        check(bench.sdo.number(0x1201, 1) == OWN_REQUEST and bench.sdo.number(0x1201, 2) == OWN_ANSWER, "1201h is open")
        robot = bench.sdo.upload(0x2003, 0)
        bench.listen_to(0x580 + NODE)
        done, whole, faults = threading.Event(), [0], []

        def master():
            try:
                while not done.is_set():
                    if bench.sdo.upload(0x2003, 0) != robot or bench.sdo.upload_block(0x2003, 0, [20]) != robot:
                        faults.append("another record")
                    whole[0] += 2
            except SystemExit:
                faults.append("a transfer was aborted")

        thread = threading.Thread(target=master)
        thread.start()
        try:
            at = f"can:vcan0:{NODE}:own"
            for _ in range(3):
                flexcomp("push", "--to", at, f"{work}/cal.yaml", "--image", f"{work}/sent")
                flexcomp("pull", "--from", at, "--image", f"{work}/pulled")
                check(read(f"{work}/sent") == read(f"{work}/pulled"), "the set comes back")
        finally:
            done.set()
            thread.join()
        check(not faults and whole[0] > 10, "the master's transfers are all whole", whole, *faults)
        # Only one of two clients stages.
        bench.listen_to(0x580 + NODE, OWN_ANSWER)
        other = Sdo(bench.bus, OWN_REQUEST, OWN_ANSWER)
        check(bench.sdo.code(Sdo.head(0x21, 0x2010, 1, struct.pack("<I", 100))) == 0, "the master begins a set")
        check(other.code(Sdo.head(0x21, 0x2010, 1, struct.pack("<I", 100))) == 0x060A0023, "the other one is told: busy")
    passed(f"[channel] three pushes over 1201h while a master read {whole[0]} records over 1200h without one abort")


def set_up_by_network(work):
    """A master opens 1201h; flexcomp uses it; a reset closes it. The controller's filter follows."""
    with Bench(work) as bench:
        at = f"can:vcan0:{NODE}:3A0-3A1"
        closed = flexcomp("status", "--of", at, "--timeout", "0.5", expect=4)
        check(f"node {NODE} is pre-operational, but may have no SDO server 1201h at 3A0h" in closed.err, "closed at first", closed)
        check(bench.sdo.download(0x1201, 1, struct.pack("<I", 0x605)) == VALUE, "a restricted COB-ID is refused")
        bench.sdo.put(0x1201, 1, 0x3A0, 4)
        bench.sdo.put(0x1201, 2, 0x3A1, 4)
        flexcomp("status", "--of", at)
        bench.nmt(RESET)
        bench.heartbeat()
        check(bench.sdo.number(0x1201, 1) == OFF, "closed after a reset")
    passed("[network] a master opens and closes 1201h, flexcomp uses it")


def process_data(work):
    """The TPDO: off by default, in operational only, at changes and by the event timer."""
    with Bench(work) as bench:
        bench.nmt(START)
        bench.heartbeat(5)
        check(not bench.frames(0x180 + NODE, 1), "nothing is sent unasked")
        bench.nmt(PRE_OPERATIONAL)
        bench.heartbeat()
        bench.sdo.put(0x1800, 3, 500, 2)
        bench.sdo.put(0x1800, 5, 200, 2)
        bench.sdo.put(0x1800, 1, 0x40000180 + NODE, 4)
        check(not bench.frames(0x180 + NODE, 1), "nor in pre-operational")
        bench.nmt(START)
        bench.heartbeat(5)
        frames = bench.frames(0x180 + NODE, 2)
        check(7 <= len(frames) <= 12, "the event timer of 200 ms", len(frames))
        check({data for _, data in frames} == {struct.pack("<BBHI", 0, 4, 1, 0)}, "no set, and the fault that there is none",
              *(data.hex() for _, data in frames))
        bench.sdo.put(0x1800, 5, 0, 2)
        bench.frames(0x180 + NODE, 0.5)
        bench.listen_to(0x180 + NODE, 0x700 + NODE)
        flexcomp("push", "--to", f"can:vcan0:{NODE}", f"{work}/cal.yaml")
        frames = bench.frames(0x180 + NODE, 1)
        check(frames and frames[-1][1][0] == 0 and frames[-1][1][4:] == struct.pack("<I", 1), "the push is told",
              *(data.hex() for _, data in frames))
        gaps = [b[0] - a[0] for a, b in zip(frames, frames[1:])]
        check(min(gaps, default=1) > 0.045, "50 ms between two", gaps)
        bench.nmt(STOP)
        bench.heartbeat(4)
        check(not bench.frames(0x180 + NODE, 0.5), "stopped: nothing")
    passed(f"[pdo] off by default; 200 ms by its timer; a push in {len(frames)} frames, 50 ms apart at least")


def memory(work):
    """1010h:2 survives SIGKILL; 1011h:2 takes it back at the next reset; a damaged file is none."""
    with Bench(work) as bench:
        check(bench.sdo.number(0x1010, 2) == 1, "1010h:2 can save")
        bench.sdo.put(0x1017, 0, 250, 2)
        bench.sdo.put(0x1015, 0, 333, 2)
        check(bench.sdo.download(0x1010, 2, b"save") == 0, "save")
        check(bench.sdo.number(0x2002, 5) == 0, "no set is committed by it")
        for damage in (False, True):
            bench.kill()
            if damage:
                record = bytearray(read(bench.store + ".can"))
                check(len(record) == 8, "the file has 8 bytes")
                record[2] ^= 1
                write(bench.store + ".can", bytes(record))
            bench.start()
            expected = (100, 1000) if damage else (250, 333)
            check((bench.sdo.number(0x1017), bench.sdo.number(0x1015)) == expected, "after a restart", damage)
        bench.sdo.put(0x1017, 0, 250, 2)
        check(bench.sdo.download(0x1010, 2, b"save") == 0, "saved over it")
        check(bench.sdo.download(0x1011, 2, b"load") == 0 and bench.sdo.number(0x1017) == 250, "load is for the next reset")
        bench.nmt(RESET)
        bench.heartbeat()
        check(bench.sdo.number(0x1017) == 100, "as built")
        os.mkdir(bench.store + ".can.new")
        check(bench.sdo.download(0x1010, 2, b"save") == 0x06060000, "a file that cannot be written")
        os.rmdir(bench.store + ".can.new")
    passed("[memory] 1010h:2 survives a killed controller, 1011h:2 takes it back, a damaged file is none")


def who_is_there(work):
    """What flexcomp says where a node does not answer."""
    import can

    def said(node=NODE, timeout="0.6", channel=""):
        return flexcomp("status", "--of", f"can:vcan0:{node}{channel}", "--timeout", timeout, expect=4).err

    with Bench(work) as bench:
        bench.nmt(STOP)
        bench.heartbeat(4)
        text = said()
        check(f"; node {NODE} is stopped" in text, "a stopped node", text)
        text = flexcomp("push", "--to", f"can:vcan0:{NODE}", f"{work}/cal.yaml", "--timeout", "0.6", expect=4).err
        check(f"; node {NODE} is stopped" in text, "and at a push", text)
        done = threading.Event()

        def seven():
            while not done.wait(0.1):
                bench.bus.send(can.Message(arbitration_id=0x707, data=[5], is_extended_id=False))

        thread = threading.Thread(target=seven)
        thread.start()
        text = said(9)
        done.set()
        thread.join()
        check(f"; heard here: {NODE}, 7" in text, "others are named", text)
        # A second controller with this number and another state: heartbeats go to and fro.
        with Bench(work, robot="twin.yaml", store="twin.bin"):
            text = said(timeout="1.5", channel=":3A0-3A1")
            check("two nodes have the number 5: its heartbeats say" in text, "two nodes, one of them stopped", text)
            bench.nmt(PRE_OPERATIONAL)
            bench.heartbeat()
            text = said()
            check("two nodes have the number 5: each request is answered twice, with serial number 0x" in text, "two that answer",
                  text)
        flexcomp("status", "--of", f"can:vcan0:{NODE}")
        bench.sdo.put(0x1017, 0, 0, 2)
        bench.nmt(STOP)
        start = time.monotonic()
        text = said()
        check("; nothing was heard" in text and time.monotonic() - start < 1.5 + SLACK, "no heartbeat at all", text)
    passed("[silence] stopped, pre-operational, others, nobody and two nodes with one number are told apart")


SECTIONS = [entries, channel, set_up_by_network, process_data, memory, who_is_there]


def run(work, names):
    for section in SECTIONS:
        if not names or section.__name__ in names:
            section(work)
    passed("all of it")


if __name__ == "__main__":
    if sys.argv[1] == "prepare":
        prepare(sys.argv[2])
    else:
        run(sys.argv[2], sys.argv[3:])
