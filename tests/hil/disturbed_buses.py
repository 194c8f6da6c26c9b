# SPDX-License-Identifier: Apache-2.0
"""flexcomp and flexcomp-controller as processes, with what disturbs a bus between them: a TCP proxy that cuts, splits, doubles
and freezes, noise on a serial line, kills of either side, two masters on two buses, and on a machine with vcan a poll, loss and
doubled frames on CAN. Every push, confirm and rollback ends in a word (active, refused, open) that is true when it is judged over a
clean connection, and the controller has a whole set. What ends open, or was killed, is settled by push --resume.

    disturbed_buses.py [TRANSFERS [SEED [CHANNEL...]]]     default 44 transfers; the long run of docs/buses.md has 2000
"""
import json
import os
import queue
import random
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import tty

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from buses import BAUD, CALIBRATION, CONTROLLER, RTU_UNIT, SOURCE, TCP_UNIT, modbus_request, read, write  # noqa: E402

# Another program than that of this build is judged by its exit status alone.
OTHER = os.environ.get("FLEXCOMP_UNDER_TEST")
FLEXCOMP = OTHER or os.path.join(os.environ["FLEXCOMP_BIN_DIR"], "flexcomp")
TIMEOUT = 0.5
# Channels on which nothing gets lost: nearly all has to get through, also on a busy machine.
WHOLE = ("tcp undisturbed", "tcp split", "rtu")
WORDS = {0: "active", 4: "refused", 5: "open"}


class Judge:
    """The controller's status and active image over a connection that nothing disturbs, by hand."""

    def __init__(self, port):
        self.port = port

    def __call__(self):
        end = time.monotonic() + 20
        while True:
            try:
                with socket.create_connection(("127.0.0.1", self.port), 5) as sock:
                    sock.settimeout(5)
                    status = self.status(sock)
                    if status["state"] == 3:  # working
                        time.sleep(0.01)
                        continue
                    image = self.image(sock, status["bytes"]) if status["slot"] != 0xFFFF else b""
                    if self.status(sock)["sequence"] == status["sequence"]:
                        return status, image
            except (OSError, struct.error, IndexError):
                time.sleep(0.05)
            if time.monotonic() > end:
                raise RuntimeError("the controller cannot be judged")

    @staticmethod
    def raw_status(sock):
        return modbus_request(sock, TCP_UNIT, struct.pack(">BHH", 3, 0x0040, 48))[2:]

    @staticmethod
    def status(sock):
        record = Judge.raw_status(sock)
        state, slot = struct.unpack_from(">H", record, 0)[0], struct.unpack_from(">H", record, 12)[0]
        sequence, size, crc, previous = struct.unpack_from(">IIII", record, 16)
        return {"state": state, "slot": slot, "sequence": sequence, "bytes": size, "crc": crc, "previous": previous}

    @staticmethod
    def image(sock, size):
        out = b""
        while len(out) < size:
            request = struct.pack(">BHHHHBI", 23, 0x0202, min(123, (size - len(out) + 1) // 2), 0x0200, 2, 4, len(out))
            out += modbus_request(sock, TCP_UNIT, request)[2:]
        return out[:size]


class Proxy:
    """TCP in front of the controller. Every connection is disturbed in one way, drawn at random."""

    def __init__(self, kind, port, rng):
        self.kind, self.port, self.rng = kind, port, rng
        self.server = socket.create_server(("127.0.0.1", 0))
        self.address = f"modbus-tcp:127.0.0.1:{self.server.getsockname()[1]}:{TCP_UNIT}"
        self.release = threading.Event()
        self.frozen_until = 0.0
        self.threads = []
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                near, _ = self.server.accept()
            except OSError:
                return
            try:
                far = socket.create_connection(("127.0.0.1", self.port), 5)
            except OSError:
                near.close()
                continue
            for end in (near, far):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            thread = threading.Thread(target=self.serve, args=(near, far), daemon=True)
            self.threads.append(thread)
            thread.start()

    def calm(self):
        """Lets go what is frozen, and waits for the connections to end."""
        self.release.set()
        self.frozen_until = 0.0
        for thread in self.threads:
            thread.join(10)
        self.threads.clear()
        self.release.clear()

    def serve(self, near, far):
        rng = self.rng
        # A push of some 1 KB is about 25 requests, in the last third of which it commits and reads back.
        left = rng.randrange(1, 60) if rng.random() < 0.8 else 10 ** 9
        open_ends = {near: far, far: near}
        try:
            while open_ends:
                ready = select.select(list(open_ends), [], [], 0.05)[0]
                if self.release.is_set() and not ready:
                    return
                if ready:
                    self.release.wait(max(0.0, self.frozen_until - time.monotonic()))
                for source in ready:
                    data = source.recv(4096)
                    if not data:
                        return
                    sink = open_ends[source]
                    left -= 1
                    if left > 0:
                        sink.sendall(data)
                        continue
                    left = rng.randrange(1, 60)
                    if self.kind == "cut":
                        sink.sendall(data[:rng.randrange(len(data) + 1)])
                        return
                    if self.kind == "split":
                        for byte in data:
                            sink.sendall(bytes([byte]))
                            if rng.random() < 0.3:
                                time.sleep(rng.random() * 0.01)
                    elif self.kind == "doubled":
                        sink.sendall(data + data)
                    elif self.kind == "frozen":
                        # One connection, or all of them and new ones; what was frozen arrives late, or very late.
                        pause = rng.choice((0.2, 0.7, 1.2, 30))
                        if rng.random() < 0.4:
                            self.frozen_until = time.monotonic() + pause
                        self.release.wait(pause)
                        sink.sendall(data)
                    else:
                        sink.sendall(data)
        except OSError:
            pass
        finally:
            # Not all at once: what was sent before the end arrives.
            for end in (near, far):
                end.close()


class Line:
    """Two pseudo-terminals and noise between them."""

    def __init__(self, work, rate, rng):
        self.rate, self.rng, self.noisy = rate, rng, False
        ends = [os.openpty(), os.openpty()]
        for _, slave in ends:
            tty.setraw(slave)
        self.masters = [master for master, _ in ends]
        names = [os.ttyname(slave) for _, slave in ends]
        self.near, self.far = names
        self.address = f"modbus-rtu:{self.near}:{BAUD}:N:{RTU_UNIT}"
        threading.Thread(target=self.relay, daemon=True).start()

    def relay(self):
        rng = self.rng
        while True:
            for source in select.select(self.masters, [], [])[0]:
                try:
                    data = bytearray(os.read(source, 512))
                except OSError:
                    continue
                if self.noisy and rng.random() < self.rate:
                    how = rng.randrange(3)
                    at = rng.randrange(len(data))
                    if how == 0:
                        data[at] ^= 1 << rng.randrange(8)
                    elif how == 1:
                        del data[at]
                    else:
                        data.insert(at, rng.randrange(256))
                os.write(self.masters[1 - self.masters.index(source)], data)


class Bench:
    def __init__(self, work, channel, rng, *options):
        self.work, self.channel, self.rng, self.options = work, channel, rng, options
        with socket.create_server(("127.0.0.1", 0)) as server:
            self.port = server.getsockname()[1]
        self.judge = Judge(self.port)
        self.clean = f"modbus-tcp:127.0.0.1:{self.port}:{TCP_UNIT}"
        self.line = Line(work, 0.02, rng)
        self.proxy = None
        self.address = self.clean
        self.lock = threading.Lock()
        if channel.startswith("tcp "):
            self.proxy = Proxy(channel[4:], self.port, rng)
            self.address = self.proxy.address
        elif channel.startswith("rtu"):
            self.address = self.line.address
        self.start()

    def start(self):
        self.controller = subprocess.Popen(
            [CONTROLLER, "--robot", f"{SOURCE}/host/robots/tx60l.yaml", "--store", f"{self.work}/store.bin",
             "--modbus-tcp", f"127.0.0.1:{self.port}:{TCP_UNIT}", "--modbus-rtu", f"{self.line.far}:{BAUD}:N:{RTU_UNIT}", *self.options],
            stdout=subprocess.PIPE, text=True)
        ready = self.controller.stdout.readline()
        assert ready.startswith("ready "), ready

    def kill_controller(self, after, gone_for):
        time.sleep(after)
        with self.lock:
            self.controller.kill()
            self.controller.wait()
            time.sleep(gone_for)
            self.start()

    def flexcomp(self, *arguments, kill_after=None, timeout=TIMEOUT):
        """The word, by exit status and JSON, which have to agree; None where the client was killed."""
        told = f"{self.work}/told.json"
        if os.path.exists(told):
            os.unlink(told)
        process = subprocess.Popen([FLEXCOMP, *arguments, "--timeout", str(timeout), "--json", told, "--quiet"],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if kill_after is not None:
            time.sleep(kill_after)
            process.kill()
        err = process.communicate(timeout=100)[1]
        if process.returncode == -signal.SIGKILL:
            return None, "killed"
        word = WORDS.get(process.returncode, f"exit {process.returncode}")
        result = json.loads(read(told, "r")) if os.path.exists(told) else {}
        if not OTHER and result.get("outcome") != word:
            return f"exit {process.returncode}, JSON {result.get('outcome')}", err
        return word, err

    def close(self):
        self.controller.kill()
        self.controller.wait()


class Counts(dict):
    KEYS = ("active", "refused", "open", "killed", "untrue", "not whole", "not resumed")

    def __init__(self):
        super().__init__({key: 0 for key in self.KEYS})
        self.complaints, self.transfers, self.seconds, self.longest = [], 0, 0.0, 0.0


def one_transfer(bench, k, counts):
    rng, work = bench.rng, bench.work
    before, image_before = bench.judge()
    what = "push"
    draw = rng.random()
    if before["state"] == 4:
        what = "confirm" if draw < 0.6 else "rollback"
    elif before["previous"] != 0 and draw < 0.12:
        what = "rollback"
    elif draw < 0.3:
        what = "trial"
    sent = f"{work}/sent"
    if os.path.exists(sent):
        os.unlink(sent)
    write(f"{work}/cal.yaml", CALIBRATION.format(name="staubli-tx60l", a=-0.08 + 1e-5 * (k % 1000)))
    arguments = {
        "push": ["push", "--to", bench.address, f"{work}/cal.yaml", "--image", sent],
        "trial": ["push", "--to", bench.address, f"{work}/cal.yaml", "--image", sent, "--trial", "3000"],
        "confirm": ["push", "--to", bench.address, "--confirm"],
        "rollback": ["rollback", "--at", bench.address],
    }[what]
    killer = None
    if bench.channel.startswith("controller killed"):
        killer = threading.Thread(target=bench.kill_controller, args=(rng.random() * 0.06, rng.choice((0.1, 0.5, 3))))
        killer.start()
    bench.line.noisy = bench.channel == "rtu noise"
    start = time.monotonic()
    word, err = bench.flexcomp(*arguments, timeout=2 if bench.channel in WHOLE else TIMEOUT,
                               kill_after=rng.random() * 0.05 if bench.channel == "client killed" else None)
    seconds = time.monotonic() - start
    counts.seconds += seconds
    counts.longest = max(counts.longest, seconds)
    if killer:
        killer.join()
    bench.line.noisy = False
    if bench.proxy:
        bench.proxy.calm()
    # What is late arrives before the controller is judged.
    time.sleep(0.02)
    now, image = bench.judge()
    image_sent = read(sent) if os.path.exists(sent) else None
    same = (now["sequence"], now["crc"]) == (before["sequence"], before["crc"])
    if what in ("push", "trial"):
        runs = image_sent is not None and image == image_sent
        whole = runs or image == image_before
        # A controller that was killed has no set on trial any more.
        if what == "trial" and bench.channel.startswith("controller killed") and not runs and word == "active":
            runs = True
        if before["state"] == 4 and bench.channel.startswith("controller killed"):
            whole = whole or bool(image)
    elif what == "confirm":
        runs = same and now["state"] == 0
        whole = image == image_before or not same
    else:
        runs = not same
        # A restart ends a trial as well.
        if before["state"] == 4 and bench.channel.startswith("controller killed") and word == "refused":
            runs = False
        whole = image == image_before or not same
    counts.transfers += 1
    counts["killed" if word is None else word] = counts.get("killed" if word is None else word, 0) + 1
    complaint = None
    if (word == "active" and not runs) or (word == "refused" and runs) or (word is not None and word not in Counts.KEYS):
        counts["untrue"] += 1
        complaint = "untrue"
    if not whole:
        counts["not whole"] += 1
        complaint = "not whole"
    if what == "push" and word in (None, "open") and not complaint and not OTHER:
        resumed, err = bench.flexcomp("push", "--to", bench.clean, f"{work}/cal.yaml", "--resume", timeout=5)
        after, image_after = bench.judge()
        good = resumed == "active" and (image_after == image_sent if runs else after["sequence"] > now["sequence"])
        if not good:
            counts["not resumed"] += 1
            complaint = "not resumed"
    if complaint:
        counts.complaints.append(f"{bench.channel}, {k}: {what} ends {word}, {complaint}; before {before}, now {now}: {err}")
    elif os.environ.get("FLEXCOMP_REASONS") and word != "active":
        counts.complaints.append(f"  {what}: {err.strip()}")


def two_masters(bench, k, counts):
    """One on TCP, one on RTU, both push at the same time: each word is true, the newest of those that are active runs."""
    work = bench.work
    ends = {}

    def push(bus, address):
        folder = f"{work}/{bus}"
        os.makedirs(folder, exist_ok=True)
        write(f"{folder}/cal.yaml", CALIBRATION.format(name="staubli-tx60l", a=-0.08 + 1e-5 * (k % 1000)))
        process = subprocess.run([FLEXCOMP, "push", "--to", address, f"{folder}/cal.yaml", "--image", f"{folder}/sent",
                                  "--timeout", str(TIMEOUT), "--json", f"{folder}/told.json", "--quiet"],
                                 capture_output=True, text=True, timeout=100)
        ends[bus] = (WORDS.get(process.returncode, str(process.returncode)), read(f"{folder}/sent"),
                     json.loads(read(f"{folder}/told.json", "r")), process.stderr)

    before = bench.judge()[1]
    start = time.monotonic()
    threads = [threading.Thread(target=push, args=at) for at in (("tcp", bench.clean), ("rtu", bench.line.address))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    seconds = time.monotonic() - start
    now, image = bench.judge()
    active = [end for end in ends.values() if end[0] == "active"]
    possible = [end for end in ends.values() if end[0] in ("active", "open")]
    good = all(word == told.get("outcome") for word, _, told, _ in ends.values())
    good = good and (image in [end[1] for end in possible] if active else image in [before, *(e[1] for e in possible)])
    if active:
        good = good and now["sequence"] >= max(end[2]["sequence"] for end in active)
    for word, _, _, _ in ends.values():
        counts[word] = counts.get(word, 0) + 1
    counts.transfers += 2
    counts.seconds += 2 * seconds
    counts.longest = max(counts.longest, seconds)
    if not good:
        counts["untrue"] += 1
        counts.complaints.append(f"{k}: {[(end[0], end[3]) for end in ends.values()]}, now {now}")


CHANNELS = ["tcp undisturbed", "tcp cut", "tcp split", "tcp doubled", "tcp frozen", "rtu", "rtu noise", "controller killed (tcp)",
            "controller killed (rtu)", "client killed", "two masters"]


def run_channel(channel, transfers, seed):
    counts = Counts()
    with tempfile.TemporaryDirectory() as work:
        bench = Bench(work, channel, random.Random(seed))
        if channel == "controller killed (rtu)":
            bench.address = bench.line.address
        try:
            k = 0
            while counts.transfers < transfers:
                (two_masters if channel == "two masters" else one_transfer)(bench, k, counts)
                k += 1
        finally:
            bench.close()
    return counts


def main(transfers=44, seed=16, *channels):
    channels = channels or CHANNELS
    each = max(1, -(-int(transfers) // len(channels)))
    todo, done = queue.Queue(), {}
    for index, channel in enumerate(channels):
        todo.put((int(seed) + index, channel))

    def work():
        while True:
            try:
                seed_of, channel = todo.get_nowait()
            except queue.Empty:
                return
            try:
                done[channel] = run_channel(channel, each, seed_of)
            except Exception as error:  # pylint: disable=broad-except
                done[channel] = error

    # They mostly wait for each other.
    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    failed = False
    print(f"| {'channel':24} | transfers | " + " | ".join(Counts.KEYS) + " | mean s | longest s |")
    complaints = []
    for channel in channels:
        counts = done[channel]
        if isinstance(counts, Exception):
            print(f"| {channel}: {counts!r}")
            failed = True
            continue
        print(f"| {channel:24} | {counts.transfers:9} | "
              + " | ".join(f"{counts[key]:{len(key)}}" for key in Counts.KEYS)
              + f" | {counts.seconds / counts.transfers:6.2f} | {counts.longest:9.2f} |")
        failed = failed or any(counts[key] for key in ("untrue", "not whole", "not resumed"))
        if channel in WHOLE:
            failed = failed or counts["active"] < counts.transfers * (0.99 if each >= 100 else 0.7)
        complaints += counts.complaints
    print(*complaints, sep="\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
