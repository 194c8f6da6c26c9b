# SPDX-License-Identifier: Apache-2.0
"""Floods on the buses of flexcomp-controller: frames, requests, answers and connections without end, from whoever can reach the bus.
Under each of them the control cycle keeps its rate, memory and descriptors stay bounded, and a push ends in a word (active,
refused, open) that is true; 2 s after the end of the flood a push gets through again.

    floods.py [--seconds S] [--pushes N] tcp|rtu|can|FLOOD...

Each flood lasts at least S seconds (default 3) and N pushes (default 1). Those on CAN inside hil/with-vcan.
"""
import argparse
import contextlib
import multiprocessing
import os
import random
import socket
import struct
import sys
import tempfile
import threading
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from buses import CALIBRATION, NODE, RTU_UNIT, TCP_UNIT, check, crc16, read, write  # noqa: E402
from disturbed_buses import Bench, Judge  # noqa: E402

READ_STATUS = struct.pack(">BHH", 3, 0x0040, 48)
CAN_RATE, RTU_BYTES_S = 2000, 11520  # frames/s; a full line of 115200 baud
TIMEOUT = 0.5
NORMAL_WITHIN_S = 2.0
# The connections' buffers of answers that nobody reads: 16 of 64 KiB, and what the allocator keeps.
MOST_GROWTH_KB = 2048


def paced(stop, count, rate, send):
    """Calls `send` so many times a second; what a sleep was too long for is made up."""
    begin = time.monotonic()
    while not stop.is_set():
        due = int((time.monotonic() - begin) * rate) - count.value
        # What a machine that is busy elsewhere has missed is not sent all at once.
        for _ in range(min(due, rate // 10)):
            try:
                send()
            except OSError:
                break
        count.value += max(0, due)
        time.sleep(0.002)


# --- CAN ---------------------------------------------------------------------------------------------------------------

EXTENDED, REMOTE = 1 << 31, 1 << 30
# Read or begun to be written: the objects of canopen_dictionary.hpp, but for commands, which another master may well give.
OBJECTS = [(0x1000, 0), (0x1001, 0), (0x1008, 0), (0x1017, 0), (0x1018, 1), (0x2000, 0), (0x2001, 0), (0x2002, 0), (0x2003, 0),
           (0x2004, 0), (0x2010, 2), (0x2020, 2), (0x2021, 1), (0x5FFF, 0)]


def can_sender(interface):
    sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    sock.bind((interface,))
    sock.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b"")
    return lambda number, data: sock.send(struct.pack("<IB3x8s", number, len(data), data.ljust(8, b"\0")))


def other_nodes(rng, node):
    """Any frames but this node's SDO and NMT."""
    number = rng.randrange(1, 0x800)
    if number in (0x600 + node, 0x580 + node):
        number += 1
    kind = rng.random()
    return number | (EXTENDED if kind < 0.2 else 0) | (REMOTE if kind > 0.9 else 0), rng.randbytes(rng.randrange(9))


def sdo_noise(rng, node):
    """Eight random bytes each; no download of a command."""
    data = rng.randbytes(8)
    return (0x600 + node, data) if data[2] not in (0x10, 0x20) else (0x600 + node, bytes(8))


def sdo_storm(rng, node):
    """Transfers that are begun and left, by segments and in blocks, and segments of nothing."""
    index, sub = rng.choice(OBJECTS)
    kind = rng.randrange(6)
    if kind < 3:
        data = struct.pack("<BHBI", (0x40, 0xA4, 0x40)[kind], index, sub, 127)
    elif kind < 5:
        data = struct.pack("<BHBI", (0x21, 0xC6)[kind - 3], 0x2010, 1, rng.randrange(2000))
    else:
        data = bytes([rng.choice((0x60, 0x70, 0x00, 0x10, 0xA2, 0xA3, 0x80))]) + bytes(7)
    return 0x600 + node, data


def forged_answers(rng, node):
    """As the node gives them in a push: begun, taken, broken off, blocks; and random ones."""
    object_of = struct.pack("<HB", *rng.choice([(0x2010, 1), (0x2011, 2), (0x2001, 0), (0x2000, 0), (0x2010, 2)]))
    kind = rng.randrange(7)
    data = [lambda: b"\x60" + object_of + bytes(4), lambda: bytes([0x20 | rng.randrange(2) << 4]) + bytes(7),
            lambda: b"\x80" + object_of + struct.pack("<I", rng.choice((0x05030000, 0x05040001, 0x08000022, 0x06020000))),
            lambda: b"\x41" + object_of + struct.pack("<I", 96), lambda: bytes([0xA2, rng.randrange(128), 127]) + bytes(5),
            lambda: b"\xa4" + object_of + bytes([127]) + bytes(3), lambda: rng.randbytes(8)][kind]()
    return 0x580 + node, data


def nmt(*commands):
    return lambda rng, node: (0, bytes([rng.choice(commands), rng.choice((0, node))]))


CAN_FLOODS = {
    "frames of other nodes": other_nodes,
    "random SDO requests": sdo_noise,
    "SDO transfers begun": sdo_storm,
    "forged SDO answers": forged_answers,
    "NMT reset": nmt(0x81, 0x82),
    "NMT start, stop, reset": nmt(1, 2, 0x80, 0x81, 0x82),
}


def can_flood(name, interface="vcan0", node=NODE, rate=CAN_RATE):
    def run(stop, count):
        rng, send = random.Random(name), can_sender(interface)
        paced(stop, count, rate, lambda: send(*CAN_FLOODS[name](rng, node)))
        if name.startswith("NMT start"):
            # A stopped node has no SDO until its master starts it.
            send(0, bytes([1, node]))
    return run


# --- Modbus RTU --------------------------------------------------------------------------------------------------------


def rtu_noise(fds):
    """Random bytes both ways, a full line."""
    def run(stop, count):
        rng = random.Random("rtu")
        paced(stop, count, RTU_BYTES_S // 16, lambda: [os.write(fd, rng.randbytes(16)) for fd in fds])
    return run


def rtu_bursts(fds):
    """20 bytes both ways, ten times a second."""
    def run(stop, count):
        rng = random.Random("rtu")
        paced(stop, count, 10, lambda: [os.write(fd, rng.randbytes(20)) for fd in fds])
    return run


def rtu_requests(fd, unit=RTU_UNIT):
    """Another master's questions without a pause, whose answers nobody waits for; now and then with a wrong CRC."""
    def run(stop, count):
        rng = random.Random("requests")

        def send():
            frame = bytes([unit]) + rng.choice([struct.pack(">BHH", 3, 0, 4), struct.pack(">BHH", 4, 0x0040, 48),
                                                struct.pack(">BHH", 8, 0, 7), b"\x42\1\2"])
            os.write(fd, frame + (crc16(frame) if rng.random() < 0.9 else b"\0\0"))
        paced(stop, count, RTU_BYTES_S // 16, send)
    return run


# --- Modbus TCP --------------------------------------------------------------------------------------------------------


def tcp_request(pdu):
    return struct.pack(">HHHB", 1, 0, len(pdu) + 1, TCP_UNIT) + pdu


def tcp_connections(port, source):
    """As fast as they can be opened: some ask, some stay, some send half a frame or none."""
    def run(stop, count):
        kept = []
        while not stop.is_set():
            with contextlib.suppress(OSError):
                sock = socket.create_connection(("127.0.0.1", port), 0.5, (source, 0))
                count.value += 1
                sock.sendall((b"", tcp_request(READ_STATUS), b"\0\1", os.urandom(40))[count.value % 4])
                kept.append(sock)
                if len(kept) > 100:
                    kept.pop(0).close()
    return run


def tcp_requests(port, reads):
    """Requests without a pause on 14 connections of another address; `reads`: and takes the answers."""
    def run(stop, count):
        many, socks = tcp_request(READ_STATUS) * 16, []
        while not stop.is_set():
            while len(socks) < 14:
                socks.append(socket.create_connection(("127.0.0.1", port), 2, ("127.0.0.2", 0)))
                socks[-1].setblocking(False)
            for sock in list(socks):
                try:
                    with contextlib.suppress(BlockingIOError):
                        count.value += sock.send(many) // len(tcp_request(READ_STATUS))
                    with contextlib.suppress(BlockingIOError):
                        if reads and not sock.recv(65536):
                            raise OSError
                except OSError:
                    socks.remove(sock)
            time.sleep(0.001)
    return run


# --- what is measured --------------------------------------------------------------------------------------------------


class Observer(threading.Thread):
    """A client of another bus, connected before the flood, that asks ten times a second: the count of control cycles."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.sock = socket.create_connection(("127.0.0.1", port), 10)
        self.last, self.slowest, self.is_over = None, 0.0, threading.Event()
        self.ask()
        self.start()

    def ask(self):
        begin = time.monotonic()
        cycles = struct.unpack_from(">I", Judge.raw_status(self.sock), 44)[0]
        self.last = cycles, time.monotonic()
        self.slowest = max(self.slowest, self.last[1] - begin)

    def run(self):
        with contextlib.suppress(OSError, struct.error):
            while not self.is_over.wait(0.1):
                self.ask()

    def end(self):
        self.is_over.set()
        self.join()
        self.sock.close()

    def rate(self, since):
        check(self.is_alive(), "a client that asks all the time is not cut off")
        (cycles, at), (before, begun) = self.last, since
        return (cycles - before) / (at - begun)


def footprint(pid):
    """Resident memory in KB now and at most, and descriptors."""
    fields = dict(line.split(":", 1) for line in read(f"/proc/{pid}/status", "r").splitlines())
    return int(fields["VmRSS"].split()[0]), int(fields["VmHWM"].split()[0]), len(os.listdir(f"/proc/{pid}/fd"))


class Flooded:
    """A flood from processes of its own."""

    def __init__(self, runs):
        self.stop, self.counts = multiprocessing.Event(), [multiprocessing.Value("q", 0) for _ in runs]
        self.processes = [multiprocessing.Process(target=run, args=(self.stop, count), daemon=True)
                          for run, count in zip(runs, self.counts)]

    def __enter__(self):
        for process in self.processes:
            process.start()
        return self

    def __exit__(self, *_):
        self.stop.set()
        for process in self.processes:
            process.join(5)
            if process.is_alive():
                process.kill()

    def sent(self):
        return sum(count.value for count in self.counts)


def new_calibration(bench):
    bench.pushes = getattr(bench, "pushes", 0) + 1
    write(f"{bench.work}/cal.yaml", CALIBRATION.format(name="staubli-tx60l", a=-0.08 + 1e-5 * bench.pushes))
    return f"{bench.work}/cal.yaml"


def push(flexcomp, bench, address, timeout=TIMEOUT):
    """The word, the reason, and the bytes that were sent or none."""
    sent = f"{bench.work}/sent"
    if os.path.exists(sent):
        os.unlink(sent)
    word, why = flexcomp("push", "--to", address, new_calibration(bench), "--image", sent, timeout=timeout)
    return word, why, read(sent) if os.path.exists(sent) else None


WORDS = ("active", "refused", "open")


def is_true(word, before, sent, now):
    """Whether the word is, by the active set's bytes before and now, and whether these are whole."""
    runs = sent is not None and now == sent
    return word in WORDS and not (word == "active" and not runs) and not (word == "refused" and runs), runs or now == before


def normal_again(flexcomp, bench, address, ended):
    """Seconds after the end until a push was begun that got through, and until it had."""
    while True:
        begun = time.monotonic()
        word, why, _ = push(flexcomp, bench, address, timeout=2)
        if word == "active":
            return begun - ended, time.monotonic() - ended
        check(begun - ended < NORMAL_WITHIN_S + 5, "the bus comes back to normal", word, why)


class Words(dict):
    """What pushes ended in, each judged."""

    def __init__(self):
        super().__init__({word: 0 for word in WORDS})
        self.untrue, self.not_whole, self.longest = 0, 0, 0.0

    def push(self, flexcomp, bench, address, active_image):
        before, begin = active_image(), time.monotonic()
        word, why, sent = push(flexcomp, bench, address)
        self.longest = max(self.longest, time.monotonic() - begin)
        # What is late arrives before it is judged.
        time.sleep(0.05)
        true, whole = is_true(word, before, sent, active_image())
        self[word] = self.get(word, 0) + 1
        self.untrue += not true
        self.not_whole += not whole
        if os.environ.get("FLEXCOMP_REASONS") or not (true and whole):
            print(f"  {word}, true {true}, whole {whole}: {why.strip()}", flush=True)

    def row(self):
        return " | ".join(str(self[word]) for word in WORDS) + f" | {self.untrue} | {self.not_whole} | {self.longest:.2f}"

    def wrong(self):
        return self.untrue or self.not_whole or len(self) != len(WORDS)


HEADER = ("| flood | sent/s | cycles/s | of a controller without it | memory, KB | descriptors | active | refused | open | untrue | not whole | "
          "longest push s | normal after s |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|")


def flood(bench, witness, name, runs, address, seconds, pushes):
    """One row of the table; what does not hold. The witness is a controller on the same machine that nobody floods: cycles that it
    leaves out as well are the machine's."""
    push(bench.flexcomp, bench, bench.clean, timeout=5)
    observer, other, words = Observer(bench.port), Observer(witness.port), Words()
    small, most = footprint(bench.controller.pid), 0
    with Flooded(runs) as flooding:
        time.sleep(0.3)
        since, since_other, begin, sent_before = observer.last, other.last, time.monotonic(), flooding.sent()
        for k in range(pushes):
            words.push(bench.flexcomp, bench, address, lambda: bench.judge()[1])
            most = max(most, footprint(bench.controller.pid)[2])
        time.sleep(max(0.0, seconds - (time.monotonic() - begin)))
        rate, quiet = observer.rate(since), other.rate(since_other)
        sent = (flooding.sent() - sent_before) / (time.monotonic() - begin)
        large = footprint(bench.controller.pid)
    ended = time.monotonic()
    observer.end()
    other.end()
    begun, done = normal_again(bench.flexcomp, bench, address, ended)
    most = max(most, large[2])
    print(f"| {name} | {sent:.0f} | {rate:.0f} | {quiet:.0f} | {small[0]} → {large[0]} | {small[2]} → {most} | {words.row()} | {done:.2f} |", flush=True)
    return [f"{name}: not so: {text}" for text, fine in (
        ("every word is true, every set whole", not words.wrong()),
        (f"the cycle keeps its rate: {rate:.0f} of {quiet:.0f}/s", rate > 0.8 * quiet),
        (f"memory is bounded: {small}, {large}", large[1] - small[1] < MOST_GROWTH_KB),
        (f"descriptors are bounded: {small[2]}, {most}", most <= small[2] + 16),
        (f"the push that got through was begun within {NORMAL_WITHIN_S} s: {begun:.2f}", begun < NORMAL_WITHIN_S)) if not fine]


def floods_of(bench):
    line = bench.line
    return {
        "tcp": {"connections from another address": [tcp_connections(bench.port, "127.0.0.2")] * 2,
                "connections from the client's address": [tcp_connections(bench.port, "127.0.0.1")] * 2,
                "requests": [tcp_requests(bench.port, True)],
                "requests whose answers nobody reads": [tcp_requests(bench.port, False)]},
        "rtu": {"noise, a full line": [rtu_noise(line.masters)],
                "noise, ten bursts/s": [rtu_bursts(line.masters)],
                "requests of another master": [rtu_requests(line.masters[1])]},
        "can": {name: [can_flood(name)] for name in CAN_FLOODS},
    }


def main(*arguments):
    wanted = argparse.ArgumentParser()
    wanted.add_argument("--seconds", type=float, default=3)
    wanted.add_argument("--pushes", type=int, default=1)
    wanted.add_argument("floods", nargs="+")
    wanted = wanted.parse_args(arguments)
    wrong = []
    with tempfile.TemporaryDirectory() as work, tempfile.TemporaryDirectory() as elsewhere:
        on_can = any(name == "can" or name in CAN_FLOODS for name in wanted.floods)
        bench = Bench(work, "floods", random.Random(16), *(["--can", f"vcan0:{NODE}"] if on_can else []))
        witness = Bench(elsewhere, "witness", random.Random(16))
        address = {"tcp": bench.clean, "rtu": bench.line.address, "can": f"can:vcan0:{NODE}"}
        try:
            print(HEADER, flush=True)
            for bus, floods in floods_of(bench).items():
                for name, runs in floods.items():
                    if bus in wanted.floods or name in wanted.floods:
                        wrong += flood(bench, witness, f"{bus.upper()}: {name}", runs, address[bus], wanted.seconds, wanted.pushes)
        finally:
            bench.close()
            witness.close()
    print(*wrong, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
