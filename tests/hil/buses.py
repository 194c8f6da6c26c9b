# SPDX-License-Identifier: Apache-2.0
"""flexcomp against flexcomp-controller over real buses, judged by programs that nobody here wrote.

    buses.py prepare WORK      makes robots, calibrations, targets and what compensate answers to them
    buses.py run WORK BUS...   runs the checks on these of: can modbus-tcp modbus-rtu

One controller serves all buses at the same time. Every check prints a line; the first one that fails ends the run.
"""
import binascii
import contextlib
import json
import math
import os
import random
import re
import signal
import socket
import struct
import subprocess
import sys
import time
import zlib

BIN = os.environ["FLEXCOMP_BIN_DIR"]
SOURCE = os.environ["FLEXCOMP_SOURCE_DIR"]
FLEXCOMP = os.path.join(BIN, "flexcomp")
CONTROLLER = os.path.join(BIN, "flexcomp-controller")
NODE, TCP_UNIT, RTU_UNIT, BAUD = 5, 1, 3, 115200
TARGETS = 300

# The programs' own limits; on top comes what a busy machine takes to start a process.
SLACK = 8.0


def passed(text):
    print(f"PASS {text}", flush=True)


def check(condition, text, *details):
    if not condition:
        print(f"FAILED {text}", *details, sep="\n  ", flush=True)
        raise SystemExit(1)


class Result:
    def __init__(self, process, seconds):
        self.status = process.returncode
        self.out = process.stdout
        self.err = process.stderr
        self.seconds = seconds

    def __str__(self):
        return f"exit {self.status} after {self.seconds:.2f} s\n  out: {self.out}\n  err: {self.err}"


def flexcomp(*arguments, expect=0):
    start = time.monotonic()
    process = subprocess.run([FLEXCOMP, *map(str, arguments)], capture_output=True, text=True, timeout=100)
    result = Result(process, time.monotonic() - start)
    if expect is not None:
        check(result.status == expect, f"exit {expect} of: flexcomp {' '.join(map(str, arguments))}", result)
    return result


def read(path, mode="rb"):
    with open(path, mode) as file:
        return file.read()


def write(path, content):
    with open(path, "wb" if isinstance(content, bytes) else "w") as file:
        file.write(content)


# --- prepare: everything that needs no bus -----------------------------------------------------------------------------

CALIBRATION = """robot: {name}
geometric:
  - {{link: 1, theta_deg: {a}, d_mm: -0.4, a_mm: 0.09, alpha_deg: 0.03}}
  - {{link: 2, theta_deg: -0.04, a_mm: -0.05, alpha_deg: 0.02, beta_deg: 0.03}}
  - {{link: 3, theta_deg: 0.05, d_mm: 0.2, a_mm: -0.1, alpha_deg: -0.05}}
  - {{link: 4, theta_deg: 0.03, d_mm: -0.1, a_mm: 0.06, alpha_deg: -0.008}}
  - {{link: 5, theta_deg: 0.06, d_mm: 0.1, a_mm: -0.08, alpha_deg: 0.01}}
  - {{link: 6, theta_deg: -0.1, d_mm: -0.3, a_mm: 0.03, alpha_deg: 0.07}}
base: {{x_mm: 0.3, y_mm: -0.2, z_mm: 0.1, rx_deg: 0.02, ry_deg: 0.01, rz_deg: 0.01}}
effects:
  - {{effect: joint_compliance, joint: 2, rad_per_nm: 1.5e-5}}
  - {{effect: joint_compliance, joint: 3, rad_per_nm: 3.2e-5}}
  - {{effect: joint_compliance, joint: 6, rad_per_nm: 1.3e-3}}
  - {{effect: link_gravity, k1_rad: 0.0015, k2_rad: 0.00123, k3_rad: 0.00054}}
  - {{effect: gear_harmonic, joint: 3, order: 1, sin_rad: 1.0e-4, cos_rad: 2.0e-5}}
  - {{effect: joint_curve, joint: 1, coefficients_rad: [0, 1.0e-4, 0, -1.0e-4, 5.0e-5, -5.0e-5, 1.0e-5]}}
  - {{effect: backlash, joint: 2, half_gap_rad: 7.0e-5}}
  - {{effect: encoder_scale, joint: 3, gain: 2.0e-4}}
  - {{effect: joint_coupling, joint: 6, from: 5, gain: 2.0e-4}}
  - {{effect: axis_wobble, joint: 2, order: 1, alpha_sin_rad: 1.0e-4, gamma_cos_rad: -5.0e-5}}
  - {{effect: thermal_growth, per_k: 12.0e-6}}
  - {{effect: base_compliance, pivot_z_mm: -375, rx_rad_per_nm: 1.0e-7, ry_rad_per_nm: 1.0e-7}}
  - {{effect: payload_error, mass_kg: 0.1, com_x_mm: 1}}
"""


def make_targets(rng, path):
    """Joint targets with every context column; the last two rows lie beyond a limit."""
    limits = [(-170, 170), (-110, 110), (-130, 130), (-250, 250), (-110, 120), (-250, 250)]
    names = [f"q{j}_deg" for j in range(1, 7)]
    names += ["payload_kg", "payload_x_mm", "payload_y_mm", "payload_z_mm", "temp_c", "time_s"]
    names += ["fx_n", "fy_n", "fz_n"] + [f"move{j}_deg" for j in range(1, 7)]
    lines = [",".join(names)]
    for k in range(TARGETS):
        q = [rng.uniform(*limit) for limit in limits]
        if k >= TARGETS - 2:
            q[k % 2] = 300.0
        row = q + [rng.uniform(0, 2), rng.uniform(-20, 20), rng.uniform(-20, 20), rng.uniform(20, 90)]
        row += [rng.uniform(10, 40), rng.uniform(0, 5000)] + [rng.uniform(-20, 20) for _ in range(3)]
        row += [rng.uniform(-60, 60) for _ in range(6)]
        lines.append(",".join(repr(v) for v in row))
    write(path, "\n".join(lines) + "\n")


def make_pose_targets(work, robot):
    """The first targets again as poses of the nominal arm, with seeds half a degree off."""
    flexcomp("predict", "--robot", robot, "--joints", f"{work}/few.csv", "-o", f"{work}/poses.csv", "--quiet")
    lines = read(f"{work}/poses.csv", "r").splitlines()
    header = lines[0].split(",")
    pose = ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
    out = [",".join(pose + [f"seed{j}_deg" for j in range(1, 7)])]
    for line in lines[1:]:
        cell = dict(zip(header, line.split(",")))
        seeds = [repr(float(cell[f"q{j}_deg"]) + 0.5) for j in range(1, 7)]
        out.append(",".join([cell[name] for name in pose] + seeds))
    write(f"{work}/pose_targets.csv", "\n".join(out) + "\n")


def prepare(work):
    rng = random.Random(2019)
    robot = f"{work}/robot.yaml"
    text = read(f"{SOURCE}/host/robots/tx60l.yaml", "r")
    name = re.search(r"^name:\s*(\S+)", text, re.M).group(1)
    write(robot, text)
    write(f"{work}/cal.yaml", CALIBRATION.format(name=name, a=-0.08))
    write(f"{work}/cal2.yaml", CALIBRATION.format(name=name, a=-0.05))
    write(f"{work}/other_name.yaml", CALIBRATION.format(name="somebody-else", a=-0.08))
    write(f"{work}/other_geometry.yaml", f"nominal_hash: {'5a' * 32}\n" + CALIBRATION.format(name=name, a=-0.08))
    make_targets(rng, f"{work}/targets.csv")
    lines = read(f"{work}/targets.csv", "r").splitlines()
    write(f"{work}/few.csv", "\n".join(",".join(line.split(",")[:6]) for line in lines[:21]) + "\n")
    make_pose_targets(work, robot)
    for number in ("", "2"):
        flexcomp("compensate", "--robot", robot, "--calibration", f"{work}/cal{number}.yaml", "--targets",
                 f"{work}/targets.csv", "-o", f"{work}/expected{number}.csv", "--quiet")
    flexcomp("compensate", "--robot", robot, "--calibration", f"{work}/cal.yaml", "--targets",
             f"{work}/pose_targets.csv", "-o", f"{work}/expected_poses.csv", "--quiet")
    statuses = [line.split(",")[8] for line in read(f"{work}/expected.csv", "r").splitlines()[1:]]
    check(statuses.count("ok") > TARGETS // 2 and statuses.count("refused") == 2, "targets of many kinds", statuses)


# --- the controller and its buses ---------------------------------------------------------------------------------------


class Bench:
    def __init__(self, work, buses):
        self.work = work
        self.buses = buses
        self.store = f"{work}/store.bin"
        self.controller = None
        self.line = None
        # Free at this moment; the controller keeps it over its restarts.
        with socket.create_server(("127.0.0.1", 0)) as server:
            self.port = server.getsockname()[1]
        near, far = f"{work}/near", f"{work}/far"
        self.near = near
        self.address = {
            "can": f"can:vcan0:{NODE}",
            "modbus-tcp": f"modbus-tcp:127.0.0.1:{self.port}:{TCP_UNIT}",
            "modbus-rtu": f"modbus-rtu:{near}:{BAUD}:N:{RTU_UNIT}",
        }
        self.arguments = ["--robot", f"{work}/robot.yaml", "--store", self.store]
        if "can" in buses:
            self.arguments += ["--can", f"vcan0:{NODE}", "--heartbeat-ms", "200"]
        if "modbus-tcp" in buses:
            self.arguments += ["--modbus-tcp", f"127.0.0.1:{self.port}:{TCP_UNIT}"]
        if "modbus-rtu" in buses:
            self.line = subprocess.Popen(["socat", f"PTY,link={near},raw,echo=0", f"PTY,link={far},raw,echo=0"])
            end = time.monotonic() + 10
            while not (os.path.exists(near) and os.path.exists(far)):
                check(time.monotonic() < end, "socat makes a serial line")
                time.sleep(0.02)
            self.arguments += ["--modbus-rtu", f"{far}:{BAUD}:N:{RTU_UNIT}"]

    def start(self):
        self.controller = subprocess.Popen([CONTROLLER, *self.arguments], stdout=subprocess.PIPE, text=True)
        ready = self.controller.stdout.readline()
        check(ready.startswith("ready "), "the controller starts", ready)
        return ready.strip()

    def kill(self):
        self.controller.send_signal(signal.SIGKILL)
        self.controller.wait()

    def close(self):
        for process in (self.controller, self.line):
            if process is not None and process.poll() is None:
                process.kill()
                process.wait()

    def status(self, bus):
        path = f"{self.work}/status.json"
        flexcomp("status", "--of", self.address[bus], "--json", path, "--quiet")
        return json.loads(read(path, "r"))


def set_of(status):
    return status["active"]["sequence"], status["active"]["crc"], status["active"]["bytes"]


def crc16(data):
    """Modbus over Serial Line V1.02, 6.2.2, bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0xA001 if crc & 1 else 0)
    return struct.pack("<H", crc)


def with_crc(image):
    return image[:-4] + struct.pack("<I", zlib.crc32(image[:-4]))


def spoiled_images(image):
    """Images that a controller must refuse by itself, with words of the reason."""
    first_term = 96
    while struct.unpack_from("<H", image, first_term)[0] != 1:
        first_term += 4 + struct.unpack_from("<H", image, first_term + 2)[0]
    newer = image[:12] + struct.pack("<I", struct.unpack_from("<I", image, 12)[0] + 100) + image[16:]
    changed = lambda at, new: newer[:at] + new + newer[at + len(new):]
    flipped = bytearray(with_crc(newer))
    flipped[len(image) // 2] ^= 0x10
    return {
        "truncated": (with_crc(newer)[:-20], "truncated"),
        "altered": (bytes(flipped), "checksum is wrong"),
        "for another robot": (with_crc(changed(48, bytes(32))), "for another robot"),
        "for another geometry": (with_crc(changed(16, bytes(32))), "for another nominal geometry"),
        "of an unknown schema": (with_crc(changed(4, b"\x09")), "schema is not known"),
        "with an unknown basis": (with_crc(changed(first_term + 6, b"\xc8")), "basis 200 is not known to the controller"),
        "with a NaN": (with_crc(changed(first_term + 24, struct.pack("<d", math.nan))), "out of range"),
        "beyond plausible": (with_crc(changed(first_term + 24, struct.pack("<d", 0.5))), "farther than is plausible"),
        "of an old sequence": (image, "sequence is not above"),
    }


def on_one_bus(bench, bus):
    work, at = bench.work, bench.address[bus]
    before = bench.status(bus)
    check(before["robot"] == "staubli-tx60l", "status tells the robot", before)
    passed(f"{bus}: status tells the robot '{before['robot']}', set {before['active']['sequence']}")

    with candump(bench, bus) as frames:
        pushed = flexcomp("push", "--to", at, f"{work}/cal.yaml", "--image", f"{work}/sent")
    sent = read(f"{work}/sent")
    now = bench.status(bus)
    check(now["active"]["sequence"] == before["active"]["sequence"] + 1, "push raises the sequence", now)
    check(int(now["active"]["crc"], 16) == zlib.crc32(sent[:-4]), "status tells the image's CRC-32", now)
    passed(f"{bus}: push ({pushed.seconds:.2f} s): {pushed.out.strip()}")
    if frames is not None:
        judge_candump(frames, sent)

    flexcomp("pull", "--from", at, "-o", f"{work}/pulled.yaml", "--image", f"{work}/received")
    check(read(f"{work}/received") == sent, "pull gives the bytes that were pushed")
    # The controller has this very set: it refuses it, but what would be pushed can be seen.
    again = flexcomp("push", "--to", at, f"{work}/pulled.yaml", "--sequence", now["active"]["sequence"], "--image",
                     f"{work}/again", expect=4)
    check(read(f"{work}/again") == sent, "a pulled file is the same image again")
    check("sequence is not above" in again.err, "the reason is told", again)
    passed(f"{bus}: pull, byte for byte; as a file, too ({len(sent)} bytes)")

    answer = flexcomp("probe", "--at", at, "--targets", f"{work}/targets.csv", "-o", f"{work}/probed.csv")
    check_equal(f"{work}/probed.csv", f"{work}/expected.csv")
    passed(f"{bus}: probe = compensate to the last digit: {answer.out.strip()}")

    for file in ("other_name", "other_geometry"):
        refused = flexcomp("push", "--to", at, f"{work}/{file}.yaml", expect=4)
        check("is for another" in refused.err and at in refused.err, "the message says what and where", refused)
    for what, (image, words) in spoiled_images(sent).items():
        write(f"{work}/spoiled", image)
        refused = flexcomp("push", "--to", at, f"{work}/spoiled", expect=4)
        check(words in refused.err, f"an image {what}: the message says '{words}'", refused)
    check(set_of(bench.status(bus)) == set_of(now), "refusals leave the controller as it was")
    check(flexcomp("pull", "--from", at, "--image", f"{work}/received") and read(f"{work}/received") == sent,
          "refusals leave the active image as it was")
    passed(f"{bus}: 2 files and {len(spoiled_images(sent))} images refused with exit 4 and the reason, set unchanged")

    flexcomp("push", "--to", at, f"{work}/cal2.yaml")
    flexcomp("probe", "--at", at, "--targets", f"{work}/targets.csv", "-o", f"{work}/probed.csv")
    check_equal(f"{work}/probed.csv", f"{work}/expected2.csv")
    flexcomp("rollback", "--at", at)
    check(set_of(bench.status(bus)) == set_of(now), "rollback brings the set before back")
    none = flexcomp("rollback", "--at", at, expect=4)
    check("no previous set" in none.err, "a second rollback is refused", none)
    passed(f"{bus}: a second set, rollback to the first, no third one to go back to")


def check_equal(path, expected):
    mine, theirs = read(path, "r").splitlines(), read(expected, "r").splitlines()
    if mine == theirs:
        return
    wrong = [k for k in range(max(len(mine), len(theirs))) if mine[k:k + 1] != theirs[k:k + 1]]
    check(False, f"{len(wrong)} of {len(theirs)} lines differ", f"line {wrong[0] + 1}", *mine[wrong[0]:wrong[0] + 1],
          *theirs[wrong[0]:wrong[0] + 1])


# --- several at once, broken transfers, restarts, silence -----------------------------------------------------------------


def all_at_once(bench):
    probes = {}
    for bus in bench.buses + ["modbus-tcp"]:
        out = f"{bench.work}/probed{len(probes)}.csv"
        probes[out] = subprocess.Popen([FLEXCOMP, "probe", "--at", bench.address[bus], "--targets",
                                        f"{bench.work}/targets.csv", "-o", out, "--quiet"])
    for out, process in probes.items():
        check(process.wait(100) == 0, f"{len(probes)} clients at once")
        check_equal(out, f"{bench.work}/expected.csv")
    passed(f"{len(probes)} clients on {len(bench.buses)} buses probe at once, each gets its own answers")

    before = bench.status("modbus-tcp")
    pushes = [subprocess.Popen([FLEXCOMP, "push", "--to", bench.address[bus], f"{bench.work}/cal.yaml", "--quiet"],
                               stderr=subprocess.PIPE, text=True) for bus in ("modbus-tcp", "modbus-tcp", "modbus-rtu")]
    ends = [(process.wait(100), process.stderr.read()) for process in pushes]
    after = bench.status("modbus-tcp")
    done = sum(status == 0 for status, _ in ends)
    check(done >= 1 and all(status in (0, 4) for status, _ in ends), "one of several pushes gets through", ends)
    check(after["state"] == "idle" and after["active"]["sequence"] > before["active"]["sequence"], "and its set is whole",
          after)
    flexcomp("probe", "--at", bench.address["modbus-tcp"], "--targets", f"{bench.work}/targets.csv", "-o",
             f"{bench.work}/probed.csv", "--quiet")
    check_equal(f"{bench.work}/probed.csv", f"{bench.work}/expected.csv")
    passed(f"3 clients push at once: {done} got through, the others were told, the set is whole")


def modbus_request(sock, unit, pdu):
    sock.sendall(struct.pack(">HHHB", 1, 0, len(pdu) + 1, unit) + pdu)
    head = sock.recv(7, socket.MSG_WAITALL)
    return sock.recv(struct.unpack(">H", head[4:6])[0] - 1, socket.MSG_WAITALL)


def broken_off(bench):
    """Half a transfer, then nothing more of it: the next push works, and the active set has not changed."""
    before = set_of(bench.status("modbus-tcp"))
    half = bytes(240)

    with socket.create_connection(("127.0.0.1", bench.port), 5) as sock:
        begin = struct.pack(">BHHBIH", 0x10, 0x00A0, 3, 6, 1000, 1)
        check(modbus_request(sock, TCP_UNIT, begin)[0] == 0x10, "begin over a plain socket")
        window = struct.pack(">BHHBI", 0x10, 0x0100, 2 + 120, 244, 0) + half
        check(modbus_request(sock, TCP_UNIT, window)[0] == 0x10, "a window over a plain socket")
        waited = flexcomp("push", "--to", bench.address["modbus-rtu"], f"{bench.work}/cal.yaml")
        check(waited.seconds > 2, "another client waits for the first one, and takes over when that has been silent for 3 s", waited)
    flexcomp("push", "--to", bench.address["modbus-tcp"], f"{bench.work}/cal.yaml")
    passed("modbus-tcp: a connection that breaks half-way leaves nothing; the next push works")

    from pymodbus.client import ModbusSerialClient
    client = ModbusSerialClient(bench.near, baudrate=BAUD, parity="N", timeout=2)
    check(client.connect(), "pymodbus opens the line")
    check(not client.write_registers(0x00A0, [0, 1000, 1], slave=RTU_UNIT).isError(), "begin by pymodbus")
    check(not client.write_registers(0x0100, [0, 0] + [0] * 100, slave=RTU_UNIT).isError(), "a window by pymodbus")
    client.close()
    flexcomp("push", "--to", bench.address["modbus-rtu"], f"{bench.work}/cal.yaml")
    passed("modbus-rtu: a transfer that stops half-way gives way to the next push")

    if "can" in bench.buses:
        import can
        with can.interface.Bus("vcan0", interface="socketcan") as bus:
            sdo = HandMadeSdo(bus)
            check(sdo.ask([0x21, 0x10, 0x20, 1, 0xE8, 3, 0, 0])[0] == 0x60, "a segmented download begins")
            check(sdo.ask([0x00] + [1] * 7)[0] == 0x20 and sdo.ask([0x10] + [2] * 7)[0] == 0x30, "two segments of it")
        flexcomp("push", "--to", bench.address["can"], f"{bench.work}/cal.yaml")
        passed("can: a transfer that stops half-way gives way to the next push")
    after = set_of(bench.status("modbus-tcp"))
    check(after[0] == before[0] + (4 if "can" in bench.buses else 3), "only whole pushes count", before, after)


def restart(bench):
    before = bench.status("modbus-tcp")
    flexcomp("pull", "--from", bench.address["modbus-tcp"], "--image", f"{bench.work}/before")
    bench.kill()
    gone = flexcomp("status", "--of", bench.address["modbus-tcp"], expect=4)
    check("Connection refused" in gone.err, "nobody listens", gone)
    ready = bench.start()
    check(set_of(bench.status("modbus-tcp")) == set_of(before), "the set survives", ready)
    flexcomp("pull", "--from", bench.address[bench.buses[0]], "--image", f"{bench.work}/after")
    check(read(f"{bench.work}/after") == read(f"{bench.work}/before"), "byte for byte")
    flexcomp("probe", "--at", bench.address[bench.buses[0]], "--targets", f"{bench.work}/targets.csv", "-o",
             f"{bench.work}/probed.csv", "--quiet")
    check_equal(f"{bench.work}/probed.csv", f"{bench.work}/expected.csv")
    passed(f"killed and started again: {ready}")


def trial(bench):
    at = bench.address["modbus-tcp"]
    before = bench.status("modbus-tcp")
    flexcomp("push", "--to", at, f"{bench.work}/cal2.yaml", "--trial", "2")
    end = time.monotonic() + 20
    while bench.status("modbus-tcp")["state"] == "trial":
        check(time.monotonic() < end, "a trial ends")
    now = bench.status("modbus-tcp")
    check(set_of(now) == set_of(before) and "trial_reverted" in now["faults"], "a trial reverts by itself", now)
    told = f"{bench.work}/told.json"
    flexcomp("push", "--to", at, f"{bench.work}/cal2.yaml", "--trial", "100", "--json", told)
    first = json.loads(read(told, "r"))
    check(first["outcome"] == "active" and first["trial"] and first["sent"], "the word and the trial in JSON", first)
    found = flexcomp("push", "--to", at, "--resume", f"{bench.work}/cal2.yaml", "--json", told)
    check("is active on trial (confirm within" in found.out and "nothing was sent" in found.out, "--resume finds the set",
          found)
    again = json.loads(read(told, "r"))
    check(again["outcome"] == "active" and again["trial"] and not again["sent"] and again["crc"] == first["crc"],
          "and sends nothing", again)
    refused = flexcomp("push", "--to", at, "--resume", f"{bench.work}/cal.yaml", "--json", told, expect=4)
    check(": refused: " in refused.err and json.loads(read(told, "r"))["outcome"] == "refused",
          "another set on trial is in the way", refused)
    flexcomp("push", "--to", at, "--confirm", "--json", told)
    check(json.loads(read(told, "r"))["outcome"] == "active", "confirmed: the word in JSON")
    refused = flexcomp("push", "--to", at, "--confirm", "--json", told, expect=4)
    check(json.loads(read(told, "r"))["outcome"] == "refused" and "; set " in refused.err, "nothing to confirm", refused)
    now = bench.status("modbus-tcp")
    check(now["state"] == "idle" and now["active"]["sequence"] == before["active"]["sequence"] + 1, "confirmed", now)
    flexcomp("rollback", "--at", at, "--json", told)
    check(json.loads(read(told, "r"))["outcome"] == "active", "rolled back: the word in JSON")
    flexcomp("push", "--to", at, "--resume", f"{bench.work}/cal2.yaml", "--json", told)
    check(json.loads(read(told, "r"))["sent"], "--resume pushes what is not active")
    flexcomp("rollback", "--at", at)
    passed("a set on trial reverts by itself, stays when confirmed; --resume finds what is active and sends what is not")


def silence(bench):
    dead = {
        "modbus-tcp": (f"modbus-tcp:127.0.0.1:{bench.port}:99", "unit 99 did not answer"),
        "modbus-rtu": (f"modbus-rtu:{bench.near}:{BAUD}:N:9", "unit 9 did not answer"),
        "can": ("can:vcan0:6", "node 6 did not answer"),
    }
    for bus in bench.buses:
        at, words = dead[bus]
        result = flexcomp("status", "--of", at, "--timeout", "0.9", expect=4)
        check(words in result.err and at in result.err, "the message says who was asked and where", result)
        check(0.85 < result.seconds < 0.9 + SLACK, "in the time that was stated", result)
        passed(f"{bus}: nobody there: exit 4 after {result.seconds:.2f} s: {result.err.strip()}")
    bench.controller.send_signal(signal.SIGSTOP)
    for bus in bench.buses:
        result = flexcomp("push", "--to", bench.address[bus], f"{bench.work}/cal.yaml", "--timeout", "0.9", expect=4)
        check("did not answer" in result.err and result.seconds < 0.9 + SLACK, "a stopped controller is given up", result)
        check(": refused: " in result.err, "nothing was sent", result)
        result = flexcomp("push", "--to", bench.address[bus], "--resume", f"{bench.work}/cal.yaml", "--timeout", "0.9",
                          "--json", f"{bench.work}/told.json", expect=5)
        check(": open: " in result.err and "hint: \"flexcomp status --of" in result.err, "an earlier push stays open", result)
        check(json.loads(read(f"{bench.work}/told.json", "r"))["outcome"] == "open", "the word in JSON")
    bench.controller.send_signal(signal.SIGCONT)
    passed("a controller that hangs: exit 4 on every bus")
    result = flexcomp("status", "--of", "can:nocan0:1", expect=4)
    check("can:nocan0:1: " in result.err, "an interface that is not there", result)
    check(flexcomp("status", "--of", "can:vcan0:200", expect=2).err.count("NODE is a whole number from 1 to 127") == 1,
          "a wrong address is a usage error")
    passed("an interface that is not there is exit 4, a wrong address exit 2")


# --- judges that nobody here wrote ----------------------------------------------------------------------------------------


@contextlib.contextmanager
def candump(bench, bus):
    """can-utils listens while something happens on CAN; the frames are there afterwards, None on another bus."""
    if bus != "can":
        yield None
        return
    frames = []
    with open(f"{bench.work}/candump.log", "w") as log:
        # A push is a burst of 800 frames, and the small kernel has one processor: the usual buffer of 200 KB
        # holds some 280 of them.
        process = subprocess.Popen(["candump", "-L", "-r", "8388608", "vcan0"], stdout=log)
        # It is listening when it has written the first heartbeat.
        end = time.monotonic() + 10
        while not os.path.getsize(f"{bench.work}/candump.log"):
            check(time.monotonic() < end, "candump hears a heartbeat")
            time.sleep(0.05)
        yield frames
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        process.wait()
    for line in read(f"{bench.work}/candump.log", "r").splitlines():
        number, data = re.fullmatch(r"\(\S+\) vcan0 ([0-9A-F]+)#([0-9A-F]*)", line).groups()
        frames.append((int(number, 16), bytes.fromhex(data)))


def image_in(frames):
    """The image, put together from the blocks that went over the wire to object 0x2010:1, and the number of answers."""
    received, answers, size = b"", 0, 0
    at, taken, inside = 0, b"", False
    for number, data in frames:
        if number == 0x600 + NODE:
            if data[:4] == bytes([0xC6, 0x10, 0x20, 1]):
                size = struct.unpack("<I", data[4:])[0]
                received, at, taken, inside = b"", 0, b"", True
            elif inside and data[0] & 0xE3 == 0xC1 and len(received) >= size:
                received, inside = received[:len(received) - (data[0] >> 2 & 7)], False
                check(len(received) == size, "the length is announced")
                check(struct.unpack("<H", data[1:3])[0] == binascii.crc_hqx(received, 0), "the CRC of the standard")
            elif inside and data[0] & 0x7F == at + 1:
                at, taken = at + 1, taken + data[1:]
        elif number == 0x580 + NODE:
            answers += 1
            check(data[0] != 0x80, "no transfer of a good push is aborted", data.hex())
            if inside and data[0] == 0xA2:
                received, at, taken = received + taken[:7 * data[1]], 0, b""
    return received, answers


def judge_candump(frames, image):
    known = {0x600 + NODE, 0x580 + NODE, 0x700 + NODE}
    seen = {number for number, _ in frames}
    check(known <= seen <= known | {0x080 + NODE}, "requests, answers, heartbeats and EMCY are on the bus", seen)
    emergencies = [data for number, data in frames if number == 0x080 + NODE]
    check(emergencies == [bytes(8)], "one EMCY: with the first set the fault that there is none has gone", emergencies)
    received, answers = image_in(frames)
    check(received == image, "candump's frames hold the image")
    passed(f"can: candump of a push: {len(frames)} frames, {answers} answers, the image is in them byte for byte")


class HandMadeSdo:
    """SDO by hand over python-can, on the channel of these COB-IDs."""

    def __init__(self, bus, request=None, answer=None):
        # NODE as it is now: the scripts of the emulators have another one.
        self.bus = bus
        self.request = request or 0x600 + NODE
        self.answer = answer or 0x580 + NODE

    def ask(self, request):
        while self.bus.recv(0) is not None:  # what others have asked since
            pass
        self.send(request)
        return self.next(bytes(request).hex())

    def upload(self, index, sub):
        answer = self.ask([0x40, index & 0xFF, index >> 8, sub, 0, 0, 0, 0])
        check(answer[1:4] == bytes([index & 0xFF, index >> 8, sub]), "the answer is about this object", answer.hex())
        if answer[0] & 2:
            return answer[4:8 - ((answer[0] >> 2) & 3)]
        check(answer[0] == 0x41, "an upload is initiated", answer.hex())
        size, out, toggle = struct.unpack("<I", answer[4:])[0], b"", 0
        while True:
            answer = self.ask([0x60 | toggle, 0, 0, 0, 0, 0, 0, 0])
            check(answer[0] & 0xF0 == toggle, "a segment with the right toggle", answer.hex())
            out += answer[1:8 - ((answer[0] >> 1) & 7)]
            toggle ^= 0x10
            if answer[0] & 1:
                check(len(out) == size, "as long as was announced")
                return out

    def send(self, data):
        import can
        self.bus.send(can.Message(arbitration_id=self.request, data=data, is_extended_id=False))

    def next(self, *details):
        end = time.monotonic() + SLACK
        while time.monotonic() < end:
            message = self.bus.recv(0.5)
            if message is not None and message.arbitration_id == self.answer:
                return bytes(message.data)
        check(False, "an SDO answer to python-can", *details)

    def upload_block(self, index, sub, blocks, lose=()):
        """Block upload with these sizes of sub-blocks in turn; loses the frames with these numbers."""
        answer = self.ask([0xA4, index & 0xFF, index >> 8, sub, blocks[0], 0, 0, 0])
        check(answer[:4] == bytes([0xC6, index & 0xFF, index >> 8, sub]), "a block upload is initiated", answer.hex())
        size, out, turn, frames, done = struct.unpack("<I", answer[4:])[0], b"", 0, 0, False
        self.send([0xA3, 0, 0, 0, 0, 0, 0, 0])
        while not done:
            taken = 0
            while True:
                segment = self.next()
                check(segment[0] != 0x80, "a segment of a block upload", segment.hex())
                frames += 1
                number, last = segment[0] & 0x7F, bool(segment[0] & 0x80)
                if number == taken + 1 and frames not in lose:
                    taken, out, done = number, out + segment[1:], last
                if last or number == blocks[turn % len(blocks)]:
                    break
            turn += 1
            self.send([0xA2, taken, blocks[turn % len(blocks)], 0, 0, 0, 0, 0])
        end = self.next()
        check(end[0] & 0xE3 == 0xC1, "the end of a block upload", end.hex())
        out = out[:len(out) - (end[0] >> 2 & 7)]
        check(len(out) == size and struct.unpack("<H", end[1:3])[0] == binascii.crc_hqx(out, 0), "size and CRC")
        self.send([0xA1, 0, 0, 0, 0, 0, 0, 0])
        return out

    def download_block(self, index, sub, data, lose=()):
        """Block download; the frames with these numbers are not sent."""
        answer = self.ask(bytes([0xC6, index & 0xFF, index >> 8, sub]) + struct.pack("<I", len(data)))
        check(answer[:4] == bytes([0xA4, index & 0xFF, index >> 8, sub]), "a block download is initiated", answer.hex())
        size, at, frames = answer[4], 0, 0
        while at < len(data):
            pieces = [data[at + 7 * k:at + 7 * k + 7] for k in range(size) if at + 7 * k < len(data)]
            for k, piece in enumerate(pieces, 1):
                last = 0x80 if at + 7 * k >= len(data) else 0
                frames += 1
                if frames not in lose:
                    self.send(bytes([k | last]) + piece.ljust(7, b"\0"))
            answer = self.next()
            check(answer[0] == 0xA2 and answer[1] <= len(pieces), "the answer to a sub-block", answer.hex())
            at, size = at + 7 * answer[1], answer[2]
        unused = -len(data) % 7
        self.send(struct.pack("<BH5x", 0xC1 | unused << 2, binascii.crc_hqx(data, 0)))
        check(self.next() == bytes([0xA1, 0, 0, 0, 0, 0, 0, 0]), "the end of a block download")


def judge_blocks_by_python_can(bench):
    import can
    pulled = f"{bench.work}/block_image"
    flexcomp("pull", "--from", bench.address["can"], "--image", pulled)
    image = bytearray(read(pulled))
    with can.interface.Bus("vcan0", interface="socketcan") as bus:
        sdo = HandMadeSdo(bus)
        for blocks in ([127], [1], [5, 9], [63, 62]):
            check(sdo.upload_block(0x2010, 2, blocks) == image, "the image in blocks", blocks)
        check(sdo.upload_block(0x2010, 2, [20], lose=(3, 25, 26)) == image, "with segments that got lost")
        check(sdo.upload_block(0x2003, 0, [127]) == sdo.upload(0x2003, 0), "the robot record in blocks")
        sequence = struct.unpack_from("<I", image, 12)[0]
        for lose in ((), (2, 40, 41, 70, 100)):
            sequence += 1
            struct.pack_into("<I", image, 12, sequence)
            struct.pack_into("<I", image, len(image) - 4, zlib.crc32(image[:-4]))
            sdo.download_block(0x2010, 1, bytes(image), lose)
            check(sdo.ask(b"\x23\x10\x10\x01save")[0] == 0x60, "save")
            end = time.monotonic() + SLACK
            while sdo.upload(0x2002, 5) != struct.pack("<I", sequence):
                check(time.monotonic() < end, "the set of the block download becomes active", lose)
            check(sdo.upload_block(0x2010, 2, [63]) == image, "and is read back")
    passed("can: python-can pushes and pulls a set by hand in blocks, also with segments that get lost")


def judge_by_python_can(bench, status):
    import can
    with can.interface.Bus("vcan0", interface="socketcan") as bus:
        sdo = HandMadeSdo(bus)
        check(sdo.upload(0x1000, 0) == bytes(4), "device type 0")
        check(sdo.upload(0x1018, 0) == b"\x04", "four entries of identity")
        check(sdo.upload(0x1018, 2) == b"1XLF", "product code FLX1")
        revision = struct.unpack("<I", sdo.upload(0x1018, 3))[0]
        check(f"{revision >> 16}.{revision >> 8 & 255}.{revision & 255}" == status["firmware"], "revision")
        check(sdo.upload(0x1018, 4) == bytes.fromhex(status["name_hash"])[:4], "serial number")
        check(sdo.upload(0x1008, 0) == b"flexcomp", "device name, segmented")
        record = sdo.upload(0x2000, 0)
        check(len(record) == 128 and record[40:72].hex() == status["nominal_hash"], "capability record, segmented")
        abort = sdo.ask([0x40, 0xFF, 0x5F, 0, 0, 0, 0, 0])
        check(abort == bytes([0x80, 0xFF, 0x5F, 0]) + struct.pack("<I", 0x06020000), "abort: no such object", abort.hex())
    passed("can: python-can reads identity and capabilities by hand, expedited and segmented")


def judge_by_modbus_tools(bench, status):
    from pymodbus.client import ModbusSerialClient, ModbusTcpClient
    expected = bytes.fromhex(status["nominal_hash"] + status["name_hash"])
    lines = {
        "modbus-tcp": (ModbusTcpClient("127.0.0.1", port=bench.port, timeout=2), TCP_UNIT,
                       ["-m", "tcp", "-p", str(bench.port), "127.0.0.1"]),
        "modbus-rtu": (ModbusSerialClient(bench.near, baudrate=BAUD, parity="N", timeout=2), RTU_UNIT,
                       ["-m", "rtu", "-b", str(BAUD), "-P", "none", bench.near]),
    }
    for bus, (client, unit, options) in lines.items():
        check(client.connect(), f"pymodbus connects on {bus}")
        for function in (client.read_holding_registers, client.read_input_registers):
            answer = function(0, 64, slave=unit)
            check(not answer.isError(), f"pymodbus reads on {bus}", answer)
            record = b"".join(struct.pack(">H", r) for r in answer.registers)
            check(record[:4] == b"\x01\x01\x00\x06" and record[40:104] == expected, "the capability record", record.hex())
        wrong = client.read_holding_registers(0x0090, 1, slave=unit)
        check(wrong.isError() and wrong.exception_code == 2, "exception 02 between the blocks", wrong)
        wrong = client.write_register(0x0000, 1, slave=unit)
        check(wrong.isError() and wrong.exception_code == 2, "exception 02 for what is only read", wrong)
        client.close()
        # mbpoll counts from 1.
        said = subprocess.run(["mbpoll", *options[:-1], "-a", str(unit), "-t", "4:hex", "-r", "21", "-c", "32", "-1",
                               "-o", "2", options[-1]], capture_output=True, text=True, timeout=30)
        words = re.findall(r"^\[\d+\]:\s+0x([0-9A-F]{4})", said.stdout, re.M)
        check(said.returncode == 0 and bytes.fromhex("".join(words)) == expected, f"mbpoll reads both hashes on {bus}",
              said.stdout, said.stderr)
        passed(f"{bus}: pymodbus (functions 03 and 04) and mbpoll read the identity registers")


def run(work, buses):
    bench = Bench(work, buses)
    try:
        passed(bench.start())
        fresh = bench.status(buses[0])
        check(fresh["faults"] == ["no_valid_set"] and fresh["active"]["sequence"] == 0, "a fresh controller has no set")
        none = flexcomp("pull", "--from", bench.address[buses[0]], "-o", f"{work}/none.yaml", expect=4)
        check("no active set" in none.err and not os.path.exists(f"{work}/none.yaml"), "nothing to pull", none)
        flexcomp("probe", "--at", bench.address[buses[0]], "--targets", f"{work}/few.csv", "-o", f"{work}/probed.csv")
        check("no_set" in read(f"{work}/probed.csv", "r"), "without a set commands pass through")
        passed("a fresh controller passes commands through and says so")
        if "can" in buses:
            judge_by_python_can(bench, fresh)
        judge_by_modbus_tools(bench, fresh)
        for bus in buses:
            on_one_bus(bench, bus)
        if "can" in buses:
            judge_blocks_by_python_can(bench)
        flexcomp("probe", "--at", bench.address[buses[0]], "--targets", f"{work}/pose_targets.csv", "-o",
                 f"{work}/probed.csv")
        check_equal(f"{work}/probed.csv", f"{work}/expected_poses.csv")
        passed("poses with seeds need no robot file: the controller tells which arm it is for")
        all_at_once(bench)
        broken_off(bench)
        restart(bench)
        trial(bench)
        silence(bench)
        check(bench.controller.poll() is None, "the controller still runs")
        bench.controller.send_signal(signal.SIGTERM)
        check(bench.controller.wait(10) == 0, "the controller ends when asked to")
        passed("all of it")
    finally:
        bench.close()


if __name__ == "__main__":
    if sys.argv[1] == "prepare":
        prepare(sys.argv[2])
    else:
        run(sys.argv[2], sys.argv[3:])
