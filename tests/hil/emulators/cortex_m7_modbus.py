# SPDX-License-Identifier: Apache-2.0
"""The emulated controller on its serial line, asked by our own client and by programs that nobody here wrote.

    cortex_m7_modbus.py WORK      inside hil/emulators/cortex-m7-modbus; WORK as `buses.py prepare` leaves it
"""
import os
import random
import re
import struct
import subprocess
import sys
import time

from emulated import Bench, Console, Master

import buses
from buses import check, check_equal, flexcomp, passed, read

UNIT, BAUD = 1, 115200


def words(registers):
    return b"".join(struct.pack(">H", r) for r in registers)


def judge_by_pymodbus(status, image):
    from pymodbus.client import ModbusSerialClient
    client = ModbusSerialClient(os.environ["FLEXCOMP_DEVICE"], baudrate=BAUD, parity="N", timeout=10)
    check(client.connect(), "pymodbus opens the line")

    def reads(address, count, function=client.read_holding_registers):
        answer = function(address, count, slave=UNIT)
        check(not answer.isError(), f"pymodbus reads {count} registers from 0x{address:04x}", answer)
        return words(answer.registers)

    for function in (client.read_holding_registers, client.read_input_registers):
        record = reads(0x0000, 64, function)
        check(record[:6] == b"\x01\x01\x00\x06\x00\x08", "protocol 1.1, six joints, double", record.hex())
        check(record[40:104].hex() == status["nominal_hash"] + status["name_hash"], "both hashes", record.hex())
        check(struct.unpack(">II", record[28:36]) == (1000, 66675), "the cycle, and the cycles in which a change of set settles", record.hex())
    record = reads(0x0040, 48)
    check(record[:2] == b"\0\0" and struct.unpack(">III", record[16:28]) == (
        status["active"]["sequence"], len(image), int(status["active"]["crc"], 16)), "the status record", record.hex())

    # pymodbus 3.0.0 names the unit differently for this function.
    sent = words(client.readwrite_registers(read_address=0x0202, read_count=40, write_address=0x0200,
                                            write_registers=[0, 100], unit=UNIT).registers)
    check(sent == image[100:180], "function 23 reads 80 bytes of the active image", sent.hex())

    def refuses(code, what, answer):
        check(answer.isError() and getattr(answer, "exception_code", None) == code, f"exception {code:02d} {what}", answer)

    refuses(1, "for coils, which there are none of", client.read_coils(0, 8, slave=UNIT))
    refuses(2, "between the blocks", client.read_holding_registers(0x0090, 1, slave=UNIT))
    refuses(2, "for a range that ends behind a block", client.read_holding_registers(0x0040, 49, slave=UNIT))
    refuses(2, "for what is only read", client.write_register(0x0000, 1, slave=UNIT))
    refuses(2, "for what is only written", client.read_holding_registers(0x0102, 1, slave=UNIT))
    refuses(3, "for 126 registers at once", client.read_holding_registers(0x0000, 126, slave=UNIT))
    refuses(4, "for a command that is not known", client.write_registers(0x00A0, [0, 0, 77], slave=UNIT))
    refuses(4, "for a commit of nothing", client.write_registers(0x00A0, [0, 0, 3], slave=UNIT))
    check(struct.unpack(">H", reads(0x0041, 1))[0] == 2, "and the status says why: wrong state")
    client.close()
    passed("pymodbus: functions 03, 04, 16 and 23, exceptions 01, 02, 03 and 04")


def judge_by_mbpoll(status):
    def mbpoll(*options):
        return subprocess.run(["mbpoll", "-m", "rtu", "-b", str(BAUD), "-P", "none", "-a", str(UNIT), "-1", "-o", "10",
                               *options, os.environ["FLEXCOMP_DEVICE"]], capture_output=True, text=True, timeout=60)

    # mbpoll counts from 1.
    said = mbpoll("-t", "4:hex", "-r", "21", "-c", "32")
    found = "".join(re.findall(r"^\[\d+\]:\s+0x([0-9A-F]{4})", said.stdout, re.M)).lower()
    check(said.returncode == 0 and found == status["nominal_hash"] + status["name_hash"], "mbpoll reads both hashes",
          said.stdout, said.stderr)
    said = mbpoll("-t", "4:hex", "-r", str(0x0090 + 1), "-c", "1")
    check(said.returncode != 0 and "Illegal data address" in said.stdout + said.stderr, "mbpoll is told exception 02",
          said.stdout, said.stderr)
    passed("mbpoll: reads the identity, is told of an address that does not exist")


def floats_for_people(console):
    """What a panel shows of the corrections is what the control cycle does."""
    console.ask("s")
    console.ask("0")
    # The direction of the last motion settles within a cycle; then nothing moves any more.
    report = console.wait(lambda r: r["active"]["idle"]["cycles"] + r["active"]["loaded"]["cycles"] > 50, "standing still")
    said = subprocess.run(["mbpoll", "-m", "rtu", "-b", str(BAUD), "-P", "none", "-a", str(UNIT), "-1", "-o", "10", "-t",
                           "4:float", "-B", "-r", str(0x0400 + 1), "-c", "6", os.environ["FLEXCOMP_DEVICE"]],
                          capture_output=True, text=True, timeout=60)
    shown = [float(v) for v in re.findall(r"^\[\d+\]:\s+(\S+)", said.stdout, re.M)]
    check(len(shown) == 6, "six floats", said.stdout, said.stderr)
    applied = [v * 1e-9 * 57.29577951308232 for v in report["correction_nrad"]]
    check(any(abs(v) > 0.01 for v in applied), "the cycle corrects", applied)
    # mbpoll prints six digits.
    check(all(abs(a - b) <= 1e-5 * abs(b) + 1e-7 for a, b in zip(shown, applied)), "mbpoll's floats are the corrections",
          shown, applied)
    console.ask("m")
    passed(f"mbpoll reads the corrections of the control cycle as floats: {', '.join(f'{v:.4f}' for v in shown)} deg")


def unknown_function():
    """The length of a frame with an unknown function is not known: it ends at the gap, and is answered."""
    master = Master(UNIT)
    check(master.ask(b"\x42\x01\x02") == b"\xc2\x01", "exception 01 for function 66")
    check(len(master.read(0x0000, 4)) == 8, "and the line is in step")
    master.close()
    passed("an unknown function code: exception 01 after the gap")


def noise():
    """A request 5 ms after noise, which is less than the gap of the line, is answered; the line counts the errors."""
    master = Master(UNIT)
    rng = random.Random(4)
    master.ask(struct.pack(">BHH", 8, 10, 0))
    rounds = 20
    for _ in range(rounds):
        os.write(master.fd, bytes(rng.randrange(256) for _ in range(rng.randint(1, 60))))
        time.sleep(0.005)
        check(len(master.read(0x0000, 4)) == 8, "a request after noise")
    errors = struct.unpack(">BHH", master.ask(struct.pack(">BHH", 8, 12, 0)))[2]
    check(master.repeated == 0 and errors >= rounds, "each at the first attempt, the errors counted", master.repeated, errors)
    master.close()
    passed(f"{rounds} requests 5 ms after noise answered; Diagnostics tells {errors} errors")


def main(work):
    bus = os.environ["FLEXCOMP_BUS"]
    bench, console = Bench(work, "modbus-rtu", bus), Console()
    fresh = bench.status("modbus-rtu")
    check(fresh["faults"] == ["no_valid_set"] and fresh["active"]["sequence"] == 0, "a fresh controller has no set")
    flexcomp("probe", "--at", bus, "--targets", f"{work}/few.csv", "-o", f"{work}/probed.csv")
    check("no_set" in read(f"{work}/probed.csv", "r"), "without a set commands pass through")
    passed("a fresh controller passes commands through and says so")

    buses.on_one_bus(bench, "modbus-rtu")
    flexcomp("probe", "--at", bus, "--targets", f"{work}/pose_targets.csv", "-o", f"{work}/probed.csv")
    check_equal(f"{work}/probed.csv", f"{work}/expected_poses.csv")
    passed("poses with seeds need no robot file: the controller tells which arm it is for")

    status = bench.status("modbus-rtu")
    judge_by_pymodbus(status, read(f"{work}/received"))
    judge_by_mbpoll(status)
    unknown_function()
    noise()
    floats_for_people(console)
    passed("all of it")


main(sys.argv[1])
