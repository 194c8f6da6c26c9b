# SPDX-License-Identifier: Apache-2.0
"""The Modbus server of flexcomp-controller against the serial and TCP guides, over real sockets and a serial line
(docs/modbus.md): functions 08, 11, 17 and 43/14 asked by pymodbus, libmodbus and mbpoll; noise; half-closed, idle, many and
greedy connections.

    modbus_standard.py WORK [SECTIONS...]
"""
import ctypes
import os
import random
import re
import select
import socket
import struct
import subprocess
import sys
import threading
import time

from buses import (BAUD, CALIBRATION, CONTROLLER, FLEXCOMP, RTU_UNIT, SLACK, SOURCE, TCP_UNIT, check, crc16, flexcomp, passed, read,
                   write)

PLACES = 16
SERVER_ID = 0xF1


class Server:
    """A controller with a serial line and TCP, or TCP alone."""

    def __init__(self, work, *options, serial=False):
        self.work = work
        self.line = None
        self.arguments = ["--robot", f"{work}/robot.yaml", "--store", f"{work}/store.bin", *options]
        if serial:
            self.near, far = f"{work}/near", f"{work}/far"
            self.line = subprocess.Popen(["socat", f"PTY,link={self.near},raw,echo=0", f"PTY,link={far},raw,echo=0"])
            end = time.monotonic() + 10
            while not (os.path.exists(self.near) and os.path.exists(far)):
                check(time.monotonic() < end, "socat makes a serial line")
                time.sleep(0.02)
            self.arguments += ["--modbus-rtu", f"{far}:{BAUD}:N:{RTU_UNIT}"]

    def __enter__(self):
        self.process = subprocess.Popen([CONTROLLER, *self.arguments, "--modbus-tcp", f"127.0.0.1:0:{TCP_UNIT}"],
                                        stdout=subprocess.PIPE, text=True)
        ready = self.process.stdout.readline()
        check(ready.startswith("ready "), "the controller starts", ready)
        self.port = int(re.search(r"modbus-tcp:127\.0\.0\.1:(\d+)", ready).group(1))
        return self

    def __exit__(self, *_):
        for process in (self.process, self.line):
            if process is not None:
                process.kill()
                process.wait()
        if os.path.exists(f"{self.work}/store.bin"):
            os.remove(f"{self.work}/store.bin")

    def client(self):
        return Client(self.port)


class Client:
    """A plain socket."""

    def __init__(self, port, timeout=SLACK):
        self.sock = socket.create_connection(("127.0.0.1", port), timeout)
        self.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.number = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.sock.close()

    def send(self, pdu, unit=TCP_UNIT):
        self.number = self.number % 65535 + 1
        self.sock.sendall(struct.pack(">HHHB", self.number, 0, len(pdu) + 1, unit) + pdu)

    def receive(self):
        """One answer; None at the end of the connection."""
        data = b""
        try:
            while len(data) < 6 or len(data) < 6 + struct.unpack(">H", data[4:6])[0]:
                more = self.sock.recv(6 + struct.unpack(">H", data[4:6])[0] - len(data) if len(data) >= 6 else 6 - len(data))
                if not more:
                    return None
                data += more
        except ConnectionError:
            return None
        return data[7:]

    def ask(self, pdu):
        try:
            self.send(pdu)
        except ConnectionError:
            return None
        return self.receive()

    def is_closed_within(self, seconds):
        """The time until the server ends the connection, None where it does not."""
        start = time.monotonic()
        self.sock.settimeout(seconds)
        try:
            while self.sock.recv(4096):
                pass
        except socket.timeout:
            return None
        except ConnectionError:
            pass
        return time.monotonic() - start


CYCLES_AT = 44  # in the status record, include/flexcomp/wire/store_state.hpp
READ_STATUS = struct.pack(">BHH", 3, 0x0040, 48)


def cycles(client):
    answer = client.ask(READ_STATUS)
    return struct.unpack_from(">I", answer, 2 + CYCLES_AT)[0]


# --- peers that nobody here wrote -------------------------------------------------------------------------------------


def peers(work):
    with Server(work, serial=True) as server:
        by_pymodbus(server)
        by_libmodbus(server)
        by_mbpoll(server)


def by_pymodbus(server):
    from pymodbus import diag_message as diag
    from pymodbus.client import ModbusSerialClient, ModbusTcpClient
    from pymodbus.mei_message import ReadDeviceInformationRequest
    from pymodbus.other_message import GetCommEventCounterRequest, ReportSlaveIdRequest

    line = ModbusSerialClient(server.near, baudrate=BAUD, parity="N", timeout=2)
    tcp = ModbusTcpClient("127.0.0.1", port=server.port, timeout=2)
    check(line.connect() and tcp.connect(), "pymodbus connects")

    def ask(client, request, unit):
        request.unit_id = unit
        answer = client.execute(request)
        check(not answer.isError(), f"pymodbus: {type(request).__name__}", answer)
        return answer

    def count(kind):
        message = ask(line, kind(), RTU_UNIT).message
        return message[0] if isinstance(message, (tuple, list)) else message

    ask(line, diag.ClearCountersRequest(), RTU_UNIT)
    kinds = [diag.ReturnBusMessageCountRequest, diag.ReturnBusCommunicationErrorCountRequest,
             diag.ReturnBusExceptionErrorCountRequest, diag.ReturnSlaveMessageCountRequest,
             diag.ReturnSlaveNoResponseCountRequest, diag.ReturnSlaveNAKCountRequest, diag.ReturnSlaveBusyCountRequest,
             diag.ReturnSlaveBusCharacterOverrunCountRequest]
    counts = [count(kind) for kind in kinds]
    check(counts == [1, 0, 0, 4, 0, 0, 0, 0], "the counters count pymodbus's own questions", counts)
    check(line.read_holding_registers(0x0090, 1, slave=RTU_UNIT).isError(), "an exception")
    check(count(diag.ReturnBusExceptionErrorCountRequest) == 1, "is counted")
    check(count(diag.ReturnDiagnosticRegisterRequest) == 1, "the diagnostic register: no valid set")
    check(count(diag.RestartCommunicationsOptionRequest) in (0, 0xFF00), "restart is answered")
    check(count(diag.ReturnBusMessageCountRequest) == 1, "and clears the counters")
    check(ask(line, GetCommEventCounterRequest(), RTU_UNIT).count == 1, "function 11: one message")
    for client, unit in ((line, RTU_UNIT), (tcp, TCP_UNIT)):
        said = ask(client, ReportSlaveIdRequest(), unit)
        check(said.identifier[:1] == bytes([SERVER_ID]) and b"flexcomp" in said.identifier, "function 17", said.identifier)
        said = ask(client, ReadDeviceInformationRequest(), unit)
        check(said.information[0] == b"flexcomp", "function 43/14", said.information)
    line.close()
    tcp.close()
    passed("pymodbus: counters (08), event counter (11), server ID (17), identification (43/14)")


def by_libmodbus(server):
    lib = ctypes.CDLL("libmodbus.so.5")
    lib.modbus_new_rtu.restype = lib.modbus_new_tcp.restype = ctypes.c_void_p
    lib.modbus_new_rtu.argtypes = [ctypes.c_char_p, ctypes.c_int, ctypes.c_char, ctypes.c_int, ctypes.c_int]
    lib.modbus_new_tcp.argtypes = [ctypes.c_char_p, ctypes.c_int]
    for name in ("modbus_connect", "modbus_close", "modbus_free", "modbus_set_slave", "modbus_report_slave_id",
                 "modbus_set_response_timeout"):
        getattr(lib, name).argtypes = None
    for made, unit in ((lib.modbus_new_rtu(server.near.encode(), BAUD, b"N", 8, 1), RTU_UNIT),
                       (lib.modbus_new_tcp(b"127.0.0.1", server.port), TCP_UNIT)):
        context = ctypes.c_void_p(made)
        lib.modbus_set_slave(context, unit)
        lib.modbus_set_response_timeout(context, ctypes.c_uint32(5), ctypes.c_uint32(0))
        check(lib.modbus_connect(context) == 0, "libmodbus connects")
        said = (ctypes.c_uint8 * 256)()
        size = lib.modbus_report_slave_id(context, 256, said)
        text = bytes(said[:max(size, 0)])
        check(size > 2 and text[0] == SERVER_ID and text[1] == 0 and text[2:].startswith(b"flexcomp "),
              "libmodbus reads ID, run indicator and data", text)
        lib.modbus_close(context)
        lib.modbus_free(context)
    passed(f"libmodbus: function 17 on both: ID 0x{SERVER_ID:02X}, off without a set, '{text[2:].decode()}'")


def by_mbpoll(server):
    said = subprocess.run(["mbpoll", "-m", "rtu", "-b", str(BAUD), "-P", "none", "-a", str(RTU_UNIT), "-u", "-o", "5",
                           server.near], capture_output=True, text=True, timeout=30)
    check(said.returncode == 0 and re.search(f"0x{SERVER_ID:02X}", said.stdout, re.I) and "flexcomp" in said.stdout,
          "mbpoll -u", said.stdout, said.stderr)
    passed("mbpoll -u: function 17 on the serial line")


# --- a serial line -----------------------------------------------------------------------------------------------------


def noise(work):
    """A request 5 ms after noise is answered, and at once."""
    rng = random.Random(3)
    request = bytes([RTU_UNIT]) + struct.pack(">BHH", 3, 0x0200, 1)
    request += crc16(request)
    rounds, times = 300, []
    with Server(work, serial=True) as server:
        fd = os.open(server.near, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        for k in range(rounds):
            os.write(fd, bytes(rng.randrange(256) for _ in range(rng.randint(1, 200))))
            time.sleep(0.005)
            os.write(fd, request)
            start, answer = time.monotonic(), b""
            while len(answer) < 7 and select.select([fd], [], [], SLACK)[0]:
                answer += os.read(fd, 256)
            check(answer[:5] == bytes([RTU_UNIT, 3, 2, 0, 0]), f"answered after noise ({k} of {rounds})", answer.hex())
            times.append(time.monotonic() - start)
        os.close(fd)
    times.sort()
    at_once = sum(t < 0.045 for t in times)
    check(at_once > rounds * 0.9, "before the gap of 50 ms is over", at_once, times[-20:])
    passed(f"modbus-rtu: {rounds} of {rounds} requests 5 ms after noise answered, {at_once} of them before the gap; median "
           f"{times[rounds // 2] * 1e3:.1f} ms")


# --- TCP connections ---------------------------------------------------------------------------------------------------


def half_closed(work):
    rounds = 300
    answered = 0
    with Server(work) as server:
        for k in range(rounds):
            with server.client() as client:
                client.send(READ_STATUS)
                if k % 3 == 0:
                    client.send(READ_STATUS)
                client.sock.shutdown(socket.SHUT_WR)
                got = [client.receive() for _ in range(2 if k % 3 == 0 else 1)]
                if all(answer is not None and len(answer) == 98 for answer in got):
                    answered += 1
                    check(client.receive() is None, "and the connection ends")
        # A long row of requests, more than is served in one turn.
        with server.client() as client:
            for _ in range(500):
                client.send(READ_STATUS)
            client.sock.shutdown(socket.SHUT_WR)
            got = 0
            while client.receive() is not None:
                got += 1
            check(got == 500, "500 requests and a half-close", got)
    check(answered == rounds, f"{answered} of {rounds} requests with half-close answered")
    passed(f"modbus-tcp: {answered} of {rounds} requests followed by a half-close answered, and a row of 500")


def rubbish(work):
    """What is not Modbus ends the connection, after the answers that were due; another protocol is discarded."""
    with Server(work) as server:
        with server.client() as client:
            client.send(READ_STATUS)
            client.sock.sendall(b"GET / HTTP/1.1\r\n\r\n" * 100)
            check(len(client.receive()) == 98 and client.receive() is None, "the answer before, then the end")
        with server.client() as client:
            client.sock.sendall(struct.pack(">HHHB", 7, 1, 6, TCP_UNIT) + READ_STATUS)
            check(len(client.ask(READ_STATUS)) == 98 and client.number == 1, "another protocol is discarded")
    passed("modbus-tcp: what is not Modbus ends its connection, another protocol identifier is discarded")


def idle(work):
    with Server(work, "--modbus-idle-s", "1") as server:
        with server.client() as silent, server.client() as torn, server.client() as busy:
            check(silent.ask(READ_STATUS) is not None, "a client")
            torn.sock.sendall(b"\0\1\0")
            stop = threading.Event()
            lost = []

            def work_on():
                while not stop.is_set():
                    if busy.ask(READ_STATUS) is None:
                        lost.append(1)
                        return
                    time.sleep(0.2)

            thread = threading.Thread(target=work_on)
            thread.start()
            took = silent.is_closed_within(1 + SLACK)
            check(took is not None and took > 0.5, "an idle connection is closed", took)
            check(torn.is_closed_within(1 + SLACK) is not None, "one that stops in a frame, too")
            time.sleep(1)
            stop.set()
            thread.join()
            check(not lost, "one that asks five times a second is not")
    with Server(work, "--modbus-idle-s", "0") as server, server.client() as silent:
        check(silent.is_closed_within(2) is None, "0: never")
    passed(f"modbus-tcp: an idle connection ends after {took:.1f} s of 1 s, one in use does not")


def keepalive(work):
    """The kernel probes a silent connection: the other end may have lost its power."""
    with Server(work) as server, server.client() as client:
        check(client.ask(READ_STATUS) is not None, "a client")
        time.sleep(0.3)
        timers = []
        for row in read("/proc/net/tcp", "r").splitlines()[1:]:
            fields = row.split()
            if fields[3] == "01" and int(fields[1].split(":")[1], 16) == server.port:
                timers.append(fields[5].split(":"))
        # Timer 2 is that of keepalive; the time is in hundredths of a second.
        check(len(timers) == 1 and timers[0][0] == "02" and int(timers[0][1], 16) <= 1000, "a probe within 10 s", timers)
    passed("modbus-tcp: TCP keepalive probes a silent client within 10 s")


def places(work):
    with Server(work) as server:
        clients = [server.client() for _ in range(PLACES)]
        for client in clients:
            check(client.ask(READ_STATUS) is not None, f"{PLACES} clients at once")
            time.sleep(0.02)
        # All have just been answered: none of them gives way.
        with server.client() as late:
            check(late.ask(READ_STATUS) is None, "another one is sent away")
        for client in clients:
            check(client.ask(READ_STATUS) is not None, "and nobody else")
        time.sleep(2.2)
        for client in clients[:3] + clients[4:]:
            check(client.ask(READ_STATUS) is not None, "all but one work on")
        with server.client() as late:
            check(late.ask(READ_STATUS) is not None, "the one that is idle gives way")
            check(clients[3].is_closed_within(SLACK) is not None, "and is told by the end of its connection")
            for client in clients[:3] + clients[4:]:
                check(client.ask(READ_STATUS) is not None, "the others stay")
        for client in clients:
            client.sock.close()
    passed(f"modbus-tcp: of {PLACES} connections the longest idle one gives way to the next; where none is idle, that is sent away")


def greedy(work):
    """One client keeps hundreds of requests under way; another one asks now and then."""
    with Server(work) as server, server.client() as flood, server.client() as calm:
        write(f"{work}/cal.yaml", CALIBRATION.format(name="staubli-tx60l", a=-0.08))
        flexcomp("push", "--to", f"modbus-tcp:127.0.0.1:{server.port}:{TCP_UNIT}", f"{work}/cal.yaml")
        stop = threading.Event()
        answers = [0]
        # What takes longest: a probe.
        probe = struct.pack(">BHHHHBH", 0x17, 0x0380, 36, 0x036C, 1, 2, 2)
        frame = struct.pack(">HHHB", 1, 0, len(probe) + 1, TCP_UNIT) + probe

        def pour():
            flood.sock.settimeout(0.2)
            while not stop.is_set():
                try:
                    flood.sock.sendall(frame * 200)
                except (socket.timeout, ConnectionError):
                    pass

        def drain():
            while not stop.is_set():
                if select.select([flood.sock], [], [], 0.2)[0]:
                    answers[0] += len(flood.sock.recv(1 << 20)) // 81

        threads = [threading.Thread(target=pour), threading.Thread(target=drain)]
        for thread in threads:
            thread.start()
        time.sleep(0.5)
        before, start, times = answers[0], time.monotonic(), []
        while time.monotonic() < start + 4:
            begin = time.monotonic()
            check(calm.ask(READ_STATUS) is not None, "the other one is answered")
            times.append(time.monotonic() - begin)
            time.sleep(0.02)
        rate = (answers[0] - before) / (time.monotonic() - start)
        stop.set()
        for thread in threads:
            thread.join()
    times.sort()
    check(rate > 300, "the greedy one is served as well", rate)
    check(times[len(times) * 9 // 10] < 0.1, "nine of ten within 100 ms", times[-10:])
    passed(f"modbus-tcp: beside a client with {rate:.0f} requests/s another one is answered in {times[len(times) // 2] * 1e3:.1f} "
           f"ms (median), {times[-1] * 1e3:.1f} ms at most")


def storm(work):
    """Connections as fast as two processes can open them, from another address; some ask, some stay, some say nothing."""
    source = """
import socket, struct, sys, time
port, end, kept, n = int(sys.argv[1]), time.monotonic() + float(sys.argv[2]), [], 0
request = struct.pack(">HHHB", 1, 0, 6, 1) + struct.pack(">BHH", 3, 0x40, 48)
while time.monotonic() < end:
    try:
        s = socket.create_connection(("127.0.0.1", port), 0.5, ("127.0.0.2", 0))
        n += 1
        if n % 3 == 0:
            s.sendall(request)
        if n % 3 == 1:
            s.sendall(b"\\0\\1")
        if n % 2:
            kept.append(s)
            if len(kept) > 100:
                kept.pop(0).close()
        else:
            s.close()
    except OSError:
        pass
print(n)
"""
    seconds = 4
    write(f"{work}/cal.yaml", CALIBRATION.format(name="staubli-tx60l", a=-0.08))
    with Server(work) as server, server.client() as client:

        def rate(duration):
            first, start, times = cycles(client), time.monotonic(), []
            while time.monotonic() < start + duration:
                begin = time.monotonic()
                check(client.ask(READ_STATUS) is not None, "the client that was there is not cut off")
                times.append(time.monotonic() - begin)
                time.sleep(0.1)
            return (cycles(client) - first) / (time.monotonic() - start), max(times)

        quiet, _ = rate(2)
        processes = [subprocess.Popen([sys.executable, "-c", source, str(server.port), str(seconds)], stdout=subprocess.PIPE,
                                      text=True) for _ in range(2)]
        time.sleep(0.3)
        pushing = subprocess.Popen([FLEXCOMP, "push", "--to", f"modbus-tcp:127.0.0.1:{server.port}:{TCP_UNIT}",
                                    f"{work}/cal.yaml"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        loud, slowest = rate(seconds - 1)
        said = pushing.communicate(timeout=60)[0]
        check(pushing.returncode == 0, "a push that begins in the storm gets through", said)
        opened = sum(int(process.communicate()[0]) for process in processes)
        time.sleep(2)
        with server.client() as after:
            check(after.ask(READ_STATUS) is not None, "a new client after the storm")
        check(opened > 500, "a storm", opened)
        check(loud > 0.8 * quiet, "the cycle keeps its rate", quiet, loud)
        check(slowest < 1, "the client is answered", slowest)
    passed(f"modbus-tcp: {opened / seconds:.0f} connections/s: {loud:.0f} cycles/s ({quiet:.0f} before), the client that was "
           f"there answered within {slowest * 1e3:.0f} ms, a push gets through")


SECTIONS = [peers, noise, half_closed, rubbish, idle, keepalive, places, greedy, storm]


def main(work, *names):
    write(f"{work}/robot.yaml", read(f"{SOURCE}/host/robots/tx60l.yaml", "r"))
    for section in SECTIONS:
        if not names or section.__name__ in names:
            section(work)


if __name__ == "__main__":
    main(*sys.argv[1:])
