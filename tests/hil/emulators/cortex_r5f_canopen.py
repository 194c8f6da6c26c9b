# SPDX-License-Identifier: Apache-2.0
"""The firmware in an emulated Cortex-R5F, on its emulated CAN controller, judged on vcan0.

    cortex_r5f_canopen.py prepare WORK   files, and what compensate answers to them; needs no bus
    cortex_r5f_canopen.py run WORK       the checks; frames.log, by candump since before the emulator started, is in WORK
    cortex_r5f_canopen.py frames WORK    what tshark makes of the frames; needs no bus

What every CANopen controller must do is checked as for flexcomp-controller, by tests/hil/buses.py. Every check prints
a line; the first one that fails ends the run.
"""
import math
import os
import random
import re
import struct
import subprocess
import sys
import time

from emulated import PATIENCE, Bench, periods_left_out

import buses
from buses import check, check_equal, flexcomp, passed, read, set_of, write

buses.NODE = NODE = 1
buses.TARGETS = 80
AT = f"can:vcan0:{NODE}"
HEARTBEAT, REQUEST, ANSWER = 0x700 + NODE, 0x600 + NODE, 0x580 + NODE
EXAMPLE = f"{buses.SOURCE}/firmware/examples/canopen_controller.c"


def prepare(work):
    buses.prepare(work)
    # Where the example's arm stands.
    numbers = re.search(r"planned_rad\[FLEXCOMP_JOINTS\] = \{([^}]*)\}", read(EXAMPLE, "r")).group(1)
    parked = [math.degrees(float(q)) for q in numbers.split(",")]
    check(len(parked) == 6, "the example's joints", numbers)
    header = ",".join(f"q{j}_deg" for j in range(1, 7))
    write(f"{work}/parked.csv", header + "\n" + ",".join(map(repr, parked)) + "\n")
    flexcomp("compensate", "--robot", f"{work}/robot.yaml", "--calibration", f"{work}/cal.yaml", "--targets",
             f"{work}/parked.csv", "-o", f"{work}/parked_corrected.csv", "--quiet")


# --- network management, heartbeat, objects: python-can and can-utils ------------------------------------------------------


def cansend(frame):
    subprocess.run(["cansend", "vcan0", frame], check=True, timeout=60)


def wait_for(bus, what, wanted):
    """The first frame of which `wanted` is true; frames before it come along."""
    before, end = [], time.monotonic() + PATIENCE
    while time.monotonic() < end:
        message = bus.recv(1.0)
        if message is None:
            continue
        frame = message.arbitration_id, bytes(message.data)
        if wanted(*frame):
            return before
        before.append(frame)
    check(False, what, *(f"{number:03X}#{data.hex()}" for number, data in before[-20:]))


def heartbeat_is(state):
    return lambda number, data: number == HEARTBEAT and data == bytes([state])


def first_words(work):
    """CiA 301, 7.3.2.2.3: after power-on one boot-up message, then pre-operational."""
    end = time.monotonic() + PATIENCE
    while True:
        frames = [line.split()[2] for line in read(f"{work}/frames.log", "r").splitlines() if line.count(" ") == 2]
        emergencies = [frame for frame in frames if frame.startswith(f"{0x080 + NODE:03X}#")]
        frames = [frame for frame in frames if frame not in emergencies]
        if len(frames) >= 2:
            break
        check(time.monotonic() < end, "a heartbeat follows the boot-up message", *frames)
        time.sleep(0.1)
    check(frames[0] == f"{HEARTBEAT:03X}#00", "the first frame is the boot-up message", *frames[:5])
    check(frames[1] == f"{HEARTBEAT:03X}#7F", "then the node is pre-operational", *frames[:5])
    check(emergencies[:1] == [f"{0x080 + NODE:03X}#0163010100000000"], "EMCY tells that there is no set", emergencies)
    passed("boot-up message, EMCY without a set, then the heartbeat of a pre-operational node (candump)")


def network_management(bench, bus):
    sdo = buses.HandMadeSdo(bus)
    cansend(f"000#02{NODE:02X}")
    wait_for(bus, "heartbeat of a stopped node", heartbeat_is(4))
    bus.send(message(REQUEST, bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0])))
    between = wait_for(bus, "and another one", heartbeat_is(4)) + wait_for(bus, "and a third", heartbeat_is(4))
    check(all(number != ANSWER for number, _ in between), "a stopped node answers no SDO", between)
    cansend("000#0100")  # to all nodes
    wait_for(bus, "heartbeat of an operational node", heartbeat_is(5))
    check(sdo.upload(0x1000, 0) == bytes(4), "an operational node answers SDO")
    cansend(f"000#02{NODE + 1:02X}")  # to another node
    between = wait_for(bus, "still operational", heartbeat_is(5))
    check(not any(heartbeat_is(4)(*frame) for frame in between), "what is for another node is not for this one")
    cansend(f"000#80{NODE:02X}")
    wait_for(bus, "heartbeat of a pre-operational node", heartbeat_is(0x7F))

    check(sdo.ask([0x2B, 0x17, 0x10, 0, 0xC8, 0, 0, 0])[0] == 0x60, "a heartbeat time of 200 ms is taken")
    check(sdo.upload(0x1017, 0) == struct.pack("<H", 200), "and read back")
    cycles = bench.status("can")["cycles"]
    cansend(f"000#81{NODE:02X}")
    wait_for(bus, "a boot-up message after a reset", heartbeat_is(0))
    wait_for(bus, "and pre-operational", heartbeat_is(0x7F))
    check(sdo.upload(0x1017, 0) == struct.pack("<H", 1000), "the reset brings the heartbeat time back")
    check(bench.status("can")["cycles"] > cycles, "the control cycle has gone on")
    passed("NMT stop, start, pre-operational and reset as the heartbeat tells (cansend, python-can); the cycle goes on")


def message(number, data):
    import can
    return can.Message(arbitration_id=number, data=data, is_extended_id=False)


def expect_abort(answer, index, sub, code, text):
    expected = bytes([0x80, index & 0xFF, index >> 8, sub]) + struct.pack("<I", code)
    check(answer == expected, text, f"got {answer.hex()}", f"expected {expected.hex()}")


def refusals(bus):
    """Abort codes of CiA 301, 7.2.4.3.17."""
    sdo = buses.HandMadeSdo(bus)
    read_of = lambda index, sub: [0x40, index & 0xFF, index >> 8, sub, 0, 0, 0, 0]
    write_of = lambda index, sub, data: [0x23 | (4 - len(data)) << 2, index & 0xFF, index >> 8, sub,
                                         *data, *bytes(4 - len(data))]
    table = [
        (read_of(0x5FFF, 0), 0x5FFF, 0, 0x06020000, "no such object"),
        (read_of(0x1018, 9), 0x1018, 9, 0x06090011, "no such sub-index"),
        (write_of(0x1000, 0, bytes(4)), 0x1000, 0, 0x06010002, "read-only"),
        (read_of(0x2010, 1), 0x2010, 1, 0x06010001, "write-only"),
        (write_of(0x1017, 0, bytes(4)), 0x1017, 0, 0x06070012, "too long"),
        (write_of(0x1017, 0, bytes(1)), 0x1017, 0, 0x06070013, "too short"),
        (write_of(0x1010, 1, b"evas"), 0x1010, 1, 0x08000020, "a wrong signature stores nothing"),
        (write_of(0x1010, 1, b"save"), 0x1010, 1, 0x08000022, "nothing is staged that could be saved"),
    ]
    for request, index, sub, code, text in table:
        expect_abort(sdo.ask(request), index, sub, code, text)
    segment_without = sdo.ask([0x60] + [0] * 7)
    check(segment_without[0] == 0x80 and segment_without[4:] == struct.pack("<I", 0x05040001), "a segment of nothing",
          segment_without.hex())
    begin = [0x21, 0x10, 0x20, 1, 0xE8, 3, 0, 0]
    check(sdo.ask(begin)[0] == 0x60 and sdo.ask([0x00] + [1] * 7)[0] == 0x20, "a download begins")
    expect_abort(sdo.ask([0x00] + [2] * 7), 0x2010, 1, 0x05030000, "a toggle bit that did not alternate")
    check(sdo.ask(begin)[0] == 0x60, "a download begins again")
    aborts = []
    wait_for(bus, "a transfer on which nothing comes is aborted",
             lambda number, data: number == ANSWER and (aborts.append(data) or True))
    expect_abort(aborts[0], 0x2010, 1, 0x05040000, "and the code says timeout")
    passed(f"{len(table) + 3} SDO aborts, each with the code of the standard (python-can)")


# --- the control cycle ---------------------------------------------------------------------------------------------------


def running_cycle(bench, bus):
    """What the cycle adds to the standing arm's command, as the node itself tells it, is what compensate adds."""
    row = lambda path: dict(zip(*(line.split(",") for line in read(path, "r").splitlines()[:2])))
    planned, corrected = row(f"{bench.work}/parked.csv"), row(f"{bench.work}/parked_corrected.csv")
    expected = [float(corrected[f"q{j}_deg"]) - float(planned[f"q{j}_deg"]) for j in range(1, 7)]
    check(max(map(abs, expected)) > 0.01, "there is something to correct", expected)
    sdo = buses.HandMadeSdo(bus)
    end = time.monotonic() + PATIENCE
    while True:  # the change of set settles
        told = [struct.unpack("<f", sdo.upload(0x2021, j))[0] for j in range(1, 7)]
        if all(abs(a - b) < 1e-6 for a, b in zip(told, expected)):
            break
        check(time.monotonic() < end, "the cycle's correction", told, expected)
        time.sleep(0.2)
    ok = lambda: bench.status("can")["cycles_by_status"]["ok"]
    before = ok()
    time.sleep(0.5)
    check(ok() > before, "the cycle goes on correcting")
    passed(f"the running cycle corrects the standing arm as compensate does: {', '.join(f'{c:.5f}' for c in told)} deg")


def no_cycle_is_missed(bench):
    """Staging, verification and commit go in slices that fit between two cycles of 125,000 instructions."""
    before, cycles = periods_left_out(), bench.status("can")["cycles"]
    for calibration in ("cal2.yaml", "cal.yaml"):
        flexcomp("push", "--to", AT, f"{bench.work}/{calibration}")
    cycles = bench.status("can")["cycles"] - cycles
    check(cycles > 100, "the cycle runs meanwhile", cycles)
    check(periods_left_out() == before, "no cycle is missed", before, periods_left_out())
    passed(f"{cycles} control cycles of 1 ms during two pushes, none missed")


# --- a crowded bus, a bad bus ----------------------------------------------------------------------------------------------


def crowded(bench, bus):
    """Other nodes' frames, far more than the 64 of the receive FIFO at once: the acceptance filter keeps them out."""
    import can
    rng = random.Random(64)
    before = set_of(bench.status("can"))
    sdo = buses.HandMadeSdo(bus)
    with can.interface.Bus("vcan0", interface="socketcan") as other:
        sent = 0
        for _ in range(20):
            for _ in range(200):
                number = rng.choice((REQUEST, rng.randrange(1, 0x800)))
                extended, remote = rng.random() < 0.2, rng.random() < 0.1
                if number in (REQUEST, ANSWER, HEARTBEAT) and not (extended or remote):
                    continue
                data = None if remote else rng.randbytes(rng.randrange(9))
                other.send(can.Message(arbitration_id=number, is_extended_id=extended, is_remote_frame=remote, data=data))
                sent += 1
            check(sdo.upload(0x1018, 2) == b"1XLF", "an answer right after other nodes' frames")
    check(set_of(bench.status("can")) == before, "other nodes' frames change nothing")
    passed(f"{sent} frames of other nodes in bursts of 200, also remote and extended ones, and an answer after each")


def tc(*arguments):
    return subprocess.run(["tc", *arguments], capture_output=True, text=True, timeout=60)


def can_lose_frames():
    """Loads what makes vcan0 lose frames. Natively another's kernel is not touched, and its vcan may not echo."""
    if os.environ.get("FLEXCOMP_VCAN_INSIDE") != "uml":
        return False
    folder = f"/usr/lib/uml/modules/{os.uname().release}/kernel/net/sched"
    subprocess.run(["insmod", f"{folder}/sch_netem.ko"], check=True, timeout=60)
    return True


def losing_frames(bench):
    if not can_lose_frames():
        print("NOT RUN frames that get lost: this kernel is not ours to change", flush=True)
        return
    work = bench.work
    before = bench.status("can")
    netem = ["dev", "vcan0", "root", "netem", "loss"]
    check(tc("qdisc", "add", *netem, "100%").returncode == 0, "netem")
    for command in (["status", "--of", AT], ["push", "--to", AT, f"{work}/cal2.yaml", "--image", f"{work}/lost0"]):
        lost = flexcomp(*command, "--timeout", "0.5", expect=4)
        check(f"node {NODE} did not answer" in lost.err, "the message says who was asked", lost)
    tc("qdisc", "del", "dev", "vcan0", "root")
    check(set_of(bench.status("can")) == set_of(before), "nothing has come through")

    # Now and then a frame: requests and answers, also that of a commit. Whatever the client was told, the controller
    # has a whole set: the one it had or one that was sent.
    flexcomp("pull", "--from", AT, "--image", f"{work}/lost0")
    possible, told, dropped = [read(f"{work}/lost0")], [], 0
    for k, loss in enumerate(("0.05%", "2%", "0.05%", "2%"), 1):  # the client's retries suffice, or they do not
        check(tc("qdisc", "add", *netem, loss).returncode == 0, "netem")
        push = flexcomp("push", "--to", AT, f"{work}/cal{'2' if k % 2 else ''}.yaml", "--timeout", "0.5", "--image",
                        f"{work}/lost{k}", expect=None)
        dropped += int(re.search(r"dropped (\d+)", tc("-s", "qdisc", "show", "dev", "vcan0").stdout).group(1))
        tc("qdisc", "del", "dev", "vcan0", "root")
        told.append(push.status)
        check(push.status in (0, 4), "a push on a bad bus is done or refused", push)
        check(push.status == 0 or AT in push.err, "and the message says where", push)
        if os.path.exists(f"{work}/lost{k}"):
            possible.append(read(f"{work}/lost{k}"))
        end = time.monotonic() + PATIENCE
        while bench.status("can")["state"] == "working":
            check(time.monotonic() < end, "what was begun is ended")
        flexcomp("pull", "--from", AT, "--image", f"{work}/now")
        now = read(f"{work}/now")
        check(now in possible and (push.status != 0 or now == possible[-1]), "a whole set, and the new one after success",
              push)
        possible = [now]
    check(dropped > 0, "frames were lost")
    flexcomp("push", "--to", AT, f"{work}/cal.yaml")
    flexcomp("probe", "--at", AT, "--targets", f"{work}/few.csv", "-o", f"{work}/probed.csv")
    flexcomp("compensate", "--robot", f"{work}/robot.yaml", "--calibration", f"{work}/cal.yaml", "--targets",
             f"{work}/few.csv", "-o", f"{work}/expected_few.csv", "--quiet")
    check_equal(f"{work}/probed.csv", f"{work}/expected_few.csv")
    passed(f"a dead bus: exit 4; {dropped} frames lost in {len(told)} pushes (exit {' '.join(map(str, told))}): always a "
           "whole set; then the next push works")


# --- afterwards: tshark's CANopen dissector ----------------------------------------------------------------------------------


def dissect(path, *fields, options=("-d", "can.subdissector,canopen")):
    """A dict per frame of a log of candump, as tshark understands it."""
    columns = [option for field in fields for option in ("-e", field)]
    said = subprocess.run(["tshark", "-r", path, *options, "-T", "fields", "-E", "header=y",
                           *columns], capture_output=True, text=True, timeout=240)
    check(said.returncode == 0, f"tshark reads {path}", said.stderr)
    lines = [line.split("\t") for line in said.stdout.splitlines()]
    return [dict(zip(lines[0], line)) for line in lines[1:]]


def frames(work):
    number = lambda text: int(text, 0)
    push = dissect(f"{work}/candump.log", "can.id", "_ws.malformed")
    check(not any(frame["_ws.malformed"] for frame in push), "no frame is malformed")
    # The dissector knows no blocks: their segments carry no specifier. It is only asked for the bytes.
    plain = dissect(f"{work}/candump.log", "can.id", "data", options=())
    image, _ = buses.image_in((number(frame["can.id"]), bytes.fromhex(frame["data"])) for frame in plain)
    check(image == read(f"{work}/sent"), "the image is in what tshark reads of the blocks to object 0x2010:1", len(image))
    all_of_it = dissect(f"{work}/frames.log", "can.id", "canopen.sdo.abort_code", "canopen.nmt_guard.state")
    from_node = lambda cob, field: [number(f[field]) for f in all_of_it if number(f["can.id"]) == cob and f[field]]
    states = from_node(HEARTBEAT, "canopen.nmt_guard.state")
    check(states[:2] == [0, 127] and set(states) == {0, 4, 5, 127}, "the states of the node", set(states))
    codes = set(from_node(ANSWER, "canopen.sdo.abort_code"))
    # What becomes of an image (0x06040043 and its like) is in the status: a check takes longer than an answer may.
    known = {0x05030000, 0x05040000, 0x05040001, 0x06010001, 0x06010002, 0x06020000, 0x06070012, 0x06070013, 0x06090011,
             0x08000020, 0x08000022}
    check(known <= codes, "the abort codes of the node", *(f"{c:08x}" for c in known - codes))
    passed(f"tshark: the image in {len(push)} frames of a push, {len(states)} heartbeats, {len(codes)} abort codes in "
           f"{len(all_of_it)} frames, none malformed in the push")


# --- all of it -------------------------------------------------------------------------------------------------------------


def run(work):
    import can
    bench = Bench(work, "can", AT)
    first_words(work)
    fresh = bench.status("can")
    check(fresh["faults"] == ["no_valid_set"] and fresh["active"]["sequence"] == 0, "a fresh controller has no set")
    check(fresh["capability"]["scalar_bytes"] == 8, "the R5F calculates in double", fresh)
    buses.judge_by_python_can(bench, fresh)
    with can.interface.Bus("vcan0", interface="socketcan") as bus:
        network_management(bench, bus)
        refusals(bus)
    buses.on_one_bus(bench, "can")
    with can.interface.Bus("vcan0", interface="socketcan") as bus:
        running_cycle(bench, bus)
    no_cycle_is_missed(bench)
    with can.interface.Bus("vcan0", interface="socketcan") as bus:
        crowded(bench, bus)
    losing_frames(bench)
    passed("all of it")


if __name__ == "__main__":
    {"prepare": prepare, "run": run, "frames": frames}[sys.argv[1]](sys.argv[2])
