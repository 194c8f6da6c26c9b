#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Stack, flash, RAM and instructions of the firmware library on one target, against docs/figures.json.

  figures.py check  --figures F.json --target cortex-m7 --build DIR --tools arm-none-eabi-
  figures.py update (the same): writes what it measures into the target's column, and the tables that show it
  figures.py instructions check|update --figures F.json --target cortex-m7 -- EMULATOR… IMAGE: the same of instructions
  figures.py speed  --build DIR --tools arm-none-eabi-: the step's functions are compiled for speed, all of them
  figures.py run    --build DIR --tools arm-none-eabi- -- EMULATOR… IMAGE: stack taken in a run against the worst
  figures.py stack  --ci A.ci [--ci B.ci] --entry NAME [--limit BYTES]: the worst stack below one function

Stack is the longest path through the call graph that the compiler wrote (-fcallgraph-info=su), frame by frame. What the
C library brings is read from the disassembly of the image. It refuses to give a figure where there is none: recursion,
a frame whose size is known only at run time, an indirect call that is not in HOOKS below, a function without a frame.

Flash is what an image with the library holds more than one without: code, constants and what initialises variables.
"""
import argparse
import pathlib
import re
import subprocess
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "docs"))
import write_tables

# Indirect calls, by the function that makes them. The library has no virtual functions; it calls hooks, some of them
# through a function of flexcomp_c.cpp that unpacks the caller's. `[]`: the caller's own function, whose stack comes on
# top of every figure here.
HOOKS = [
    (r"_ZNK?8flexcomp8firmware5(Store|Slots)\w*",
     [r"_ZN12_GLOBAL__N_13Arm(4read|5erase|5write)E\w*", r"_ZN8flexcomp8firmware5Store15check_signatureE\w*"]),
    (r"_ZN8flexcomp8firmware14SignatureCheck\w*", [r"_ZN12_GLOBAL__N_13Arm5checkE\w*"]),
    (r"_ZN12_GLOBAL__N_13Arm(4read|5erase|5write|5check)E\w*", []),
    (r"_ZN8flexcomp8firmware6Device(4boot|4poll|3run|13begin_unknown)E[\w.]*",
     [r"_ZN8flexcomp8firmware6Device7observeE[\w.]*", r"_ZN12_GLOBAL__N_13Arm(6permit|3log)E\w*"]),
    (r"_ZN8flexcomp8firmware6Device(7observe|12is_permitted)E[\w.]*", [r"_ZN12_GLOBAL__N_13Arm(6permit|3log)E\w*"]),
    (r"_ZZN8flexcomp8firmware6Device7observe[\w.]*", [r"_ZN12_GLOBAL__N_13Arm3logE\w*"]),
    (r"_ZN12_GLOBAL__N_13Arm(6permit|3log)E\w*", []),
    (r"_ZN8flexcomp8firmware11CanopenNode\w*", [r"_ZN12_GLOBAL__N_13Can8transmitE\w*"]),
    (r"_ZN12_GLOBAL__N_13Can8transmitE\w*", []),
    (r"_ZN8flexcomp8firmware9Modbus(Rtu|Tcp)\w*", []),
]

ENTRIES = ["init", "boot", "step", "step_rate", "uncorrect", "tool_pose", "joint_loads", "poll",
           "get_state", "command", "can_receive", "can_poll", "rtu_receive", "rtu_poll", "tcp_receive"]
# flexcomp_init is a macro.
FUNCTIONS = {"init": "flexcomp_init_checked"}
# Sources that are compiled for speed, and what they share with the others but do not call in a cycle.
STEP = {"control", "arithmetic"}
NOT_OF_THE_STEP = r"float_from_bits|bits_from_float"
# Never returns, so nothing comes back to a stack above it.
END_OF_ALL = {"flexcomp_fault"}


class Refused(Exception):
    pass


class CallGraph:
    """Functions by mangled name: frame in bytes, callees."""

    def __init__(self):
        self.frame, self.calls = {}, {}

    def read(self, path):
        text = pathlib.Path(path).read_text()
        name = lambda title: title.rsplit(":", 1)[-1]
        for title, label in re.findall(r'^node: \{ title: "([^"]*)" label: "([^"]*)"', text, re.M):
            found = re.search(r"(\d+) bytes \(([^)]*)\)", label)
            if not found:
                continue  # a declaration: its definition is elsewhere
            if found[2] != "static":
                raise Refused(f"{name(title)}: the size of its frame is known only at run time ({found[2]})")
            self.frame[name(title)] = max(int(found[1]), self.frame.get(name(title), 0))
        for source, to in re.findall(r'^edge: \{ sourcename: "([^"]*)" targetname: "([^"]*)"', text, re.M):
            self.calls.setdefault(name(source), set()).add(name(to))

    def read_image(self, image, tools):
        """What the compiler's graph does not have: frames of the C library's functions, by what they push, and every
        call that is in the image (the compiler does not note the ones that it makes up itself)."""
        dump = subprocess.run([tools + "objdump", "-d", "--no-show-raw-insn", image], check=True, text=True,
                              capture_output=True).stdout
        # A number that the linker script defines may lie inside a function, whose own jumps are then told by it.
        listed = subprocess.run([tools + "nm", image], check=True, text=True, capture_output=True).stdout
        numbers = set(re.findall(r"^[0-9a-f]+ [Aa] (\S+)$", listed, re.M))
        bytes_of = {"s": 4, "d": 8}
        for name, body in re.findall(r"^[0-9a-f]+ <([^>]+)>:\n((?:.+\n)*)", dump, re.M):
            frame, calls = 0, set()
            for line in body.splitlines():
                fields = line.split("\t", 2)[1:]
                if not fields:
                    continue
                op, args = fields[0], fields[1] if len(fields) > 1 else ""
                args = re.sub(r"[@;].*", "", args)
                if frame is None or name in self.frame:
                    pass
                elif re.match(r"(push|stmdb|stmfd)", op) and (op.startswith("push") or args.startswith("sp!")):
                    registers = re.search(r"\{([^}]*)\}", args)[1].split(",")
                    frame += 4 * sum(self._count(r) for r in registers)
                elif op.startswith("vpush"):
                    registers = re.search(r"\{([^}]*)\}", args)[1].split(",")
                    frame += sum(self._count(r) * bytes_of[r.strip()[0]] for r in registers)
                elif re.match(r"sub", op) and re.match(r"sp, (sp, )?#", args):
                    frame += int(re.search(r"#(\d+)", args)[1])
                elif re.match(r"sub", op) and args.startswith("sp"):
                    frame = None  # only the compiler can say
                elif re.search(r"\[sp, #-(\d+)\]!", args):
                    frame += int(re.search(r"\[sp, #-(\d+)\]!", args)[1])
                # Calls, and jumps out of the function, which are calls at its end.
                if re.match(r"(b|bl|blx|bx|cbn?z)\b|b(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)\b", op):
                    to = re.search(r"<([^>+]+)(\+[^>]*)?>", args)
                    if to and to[1] in numbers:
                        pass
                    elif to and to[1] != name:
                        calls.add(to[1])
                    elif not to and (op == "blx" or (op == "bx" and args.strip() != "lr")):
                        calls.add("__indirect_call")
            if name not in self.frame and frame is not None:
                self.frame[name] = frame
            self.calls.setdefault(name, set()).update(calls)

    @staticmethod
    def _count(register):
        ends = re.findall(r"\d+", register)
        return int(ends[1]) - int(ends[0]) + 1 if len(ends) == 2 and "-" in register else 1

    def callees(self, name):
        out = set()
        for to in self.calls.get(name, ()):
            if to != "__indirect_call":
                out.add(to)
                continue
            for caller, hooks in HOOKS:
                if re.fullmatch(caller, name):
                    out.update(f for f in self.frame for hook in hooks if re.fullmatch(hook, f))
                    break
            else:
                raise Refused(f"{name}: calls through a pointer that this script does not know")
        return out - END_OF_ALL

    def worst(self, name, above=()):
        """Bytes below and in a function, and the path to them."""
        if name in above:
            raise Refused("recursion: " + " -> ".join(above[above.index(name):] + (name,)))
        if name not in self.frame:
            raise Refused(f"{name}: nothing says how much stack it takes" + (f" (called by {above[-1]})" if above else ""))
        deepest, path = 0, ()
        for to in sorted(self.callees(name)):
            if to not in self._known:
                self._known[to] = self.worst(to, above + (name,))
            if self._known[to][0] > deepest:
                deepest, path = self._known[to]
        return self.frame[name] + deepest, (name,) + path

    _known = {}


def sections(image, tools):
    """Bytes that an image takes of flash, and of variables that are not zero or zero at the start."""
    out = subprocess.run([tools + "size", "-A", image], check=True, text=True, capture_output=True).stdout
    size = {line.split()[0]: int(line.split()[1]) for line in out.splitlines() if line.startswith(".")}
    return (sum(size.get(s, 0) for s in (".text", ".ARM.exidx", ".data")),
            sum(size.get(s, 0) for s in (".data", ".bss")))


def symbol_sizes(path, tools):
    out = subprocess.run([tools + "nm", "-S", path], check=True, text=True, capture_output=True).stdout
    return {line.split()[3]: int(line.split()[1], 16) for line in out.splitlines() if len(line.split()) == 4}


def measure(build, tools):
    build = pathlib.Path(build)
    image = lambda name: str(build / "bin" / f"target_size_{name}.elf")
    figures = {}
    nothing = sections(image("nothing"), tools)
    for name in ("core_store", "both_buses"):
        figures[f"flash {name}"] = sections(image(name), tools)[0] - nothing[0]
    memory = symbol_sizes(next(build.glob("tests/target/CMakeFiles/target_size_memory.dir/size/memory.c.obj")), tools)
    figures["ram arm"] = memory["ram_arm"]
    figures["ram can"] = memory["ram_can"]
    figures["ram rtu"] = memory["ram_rtu"]
    figures["ram tcp"] = memory["ram_tcp"]
    figures["ram arm+can+rtu"] = memory["ram_arm"] + memory["ram_can"] + memory["ram_rtu"]
    figures["ram sets and staging"] = memory["ram_sets_and_staging"]
    given = symbol_sizes(image("both_buses"), tools)
    own = sum(size for name, size in given.items() if name in ("memory", "can_memory", "rtu_memory", "unknown_robot"))
    # Sections are filled up to 8 bytes.
    figures["ram static"] = max(0, (sections(image("both_buses"), tools)[1] - nothing[1] - own) // 8 * 8)
    graph, paths = call_graph(build, tools), {}
    for entry in ENTRIES:
        figures[f"stack {entry}"], paths[entry] = graph.worst(FUNCTIONS.get(entry, f"flexcomp_{entry}"))
    return figures, paths


def call_graph(build, tools):
    graph = CallGraph()
    files = sorted(pathlib.Path(build).glob("firmware/CMakeFiles/flexcomp_firmware.dir/src/*.ci"))
    if not files:
        raise Refused(f"no call graph of the compiler's below {build}")
    for path in files:
        graph.read(path)
    graph.read_image(str(pathlib.Path(build) / "bin" / "target_firmware_links.elf"), tools)
    return graph


def in_a_run(args):
    """What an emulated run takes of the stack, against the worst that the call graph gives. Below it, or the graph is
    wrong; and the step and the boot, whose paths are mostly straight, not far below it, or the graph is idle."""
    graph = call_graph(args.build, args.tools)
    out = subprocess.run(args.command, check=True, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT).stdout
    taken = {name: int(size, 16) for name, size in re.findall(r"^stack (\w+) 0x([0-9a-f]+)", out, re.M)}
    if set(taken) != {"step", "boot", "rtu_receive"}:
        raise Refused(f"the run says {out!r}")
    bad = 0
    # The call that is measured goes through a function of one push, by a pointer.
    around = 16
    for name, size in taken.items():
        worst, _ = graph.worst(f"flexcomp_{name}")
        ok = size <= worst + around and (name == "rtu_receive" or size > 0.6 * worst)
        bad += not ok
        print(f"{name}: {size} bytes in this run, {worst} at worst: {'ok' if ok else 'THESE DO NOT GO TOGETHER'}")
    return 1 if bad else 0


def speed(args):
    """Functions that the linker could take from a source compiled for size although the step calls them: the same
    inline function is in several objects, and the linker keeps the first."""
    where = pathlib.Path(args.build) / "firmware/CMakeFiles/flexcomp_firmware.dir/src"
    weak = {}
    for path in where.glob("*.obj"):
        out = subprocess.run([args.tools + "nm", str(path)], check=True, text=True, capture_output=True).stdout
        weak[path.name.split(".")[0]] = {line.split()[2] for line in out.splitlines() if re.match(r"\w+ W ", line)}
    if not STEP.issubset(weak):
        raise Refused(f"no objects of {sorted(STEP)} below {where}")
    step = set().union(*(weak[name] for name in STEP))
    shared = {f for name in set(weak) - STEP for f in weak[name] & step if not re.search(NOT_OF_THE_STEP, f)}
    for name in sorted(shared):
        print(f"in an object of the step and in one that is compiled for size: {name}")
    return 1 if shared else 0


def compare(args, figures, table, update_target):
    """Against docs/figures.json: 1 where a figure has grown by more than 2 % or is above its limit."""
    rows = {row["figure"]: row for row in write_tables.load(args.figures)[table]["rows"]}
    bad = 0
    for name, value in figures.items():
        row = rows.get(name, {})
        documented, limit = row.get(args.target), row.get("limit")
        verdict = "ok"
        if documented is None:
            verdict = "NOT DOCUMENTED"
        elif value > documented * 1.02:
            verdict = "ABOVE what is documented by more than 2 %"
        elif limit is not None and value > limit:
            verdict = "ABOVE its limit"
        elif value < documented * 0.9:
            verdict = "ok (far below: the figure could be written anew)"
        bad += not verdict.startswith("ok")
        print(f"{name:40} {value:7} documented {documented} at most {limit}: {verdict}")
    if bad:
        print(f"{bad} figures are not as {args.figures} says; \"cmake --build --preset {args.target} --target"
              f" {update_target}\" writes them anew")
    return 1 if bad else 0


def write(args, figures, table):
    documented = write_tables.load(args.figures)
    rows = {row["figure"]: row for row in documented[table]["rows"]}
    missing = [name for name in figures if name not in rows]
    if missing:
        print("rows that the table does not have: " + ", ".join(missing))
        return 1
    for name, value in figures.items():
        rows[name][args.target] = value
    write_tables.save(documented, args.figures)
    return write_tables.main([])


def check(args):
    figures, _ = measure(args.build, args.tools)
    return compare(args, figures, "target_bytes", "figures")


def update(args):
    figures, paths = measure(args.build, args.tools)
    if write(args, figures, "target_bytes"):
        return 1
    for entry, path in paths.items():
        print(f"flexcomp_{entry}: " + " > ".join(path))
    return 0


def instructions(args):
    """What budget_parts.elf prints: one "name: count" a line."""
    run = subprocess.run(args.command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                         text=True)
    figures = {m[1]: int(m[2]) for m in re.finditer(r"^(.+): (\d+)$", run.stdout, re.M)}
    if run.returncode != 0 or len(figures) < 10:
        print(run.stdout)
        raise Refused(f"the image ended with status {run.returncode}")
    if args.what == "update":
        return write(args, figures, "target_instructions")
    return compare(args, figures, "target_instructions", "instructions")


def stack(args):
    graph = CallGraph()
    for path in args.ci:
        graph.read(path)
    size, path = graph.worst(args.entry)
    print(f"{args.entry}: {size} bytes: " + " > ".join(f"{f} ({graph.frame[f]})" for f in path))
    if args.limit and size > args.limit:
        print(f"more than the {args.limit} bytes allowed")
        return 1
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    for name, run in (("check", check), ("update", update)):
        command = commands.add_parser(name)
        for option in ("--figures", "--target", "--build", "--tools"):
            command.add_argument(option, required=True)
        command.set_defaults(run=run)
    command = commands.add_parser("speed")
    for option in ("--build", "--tools"):
        command.add_argument(option, required=True)
    command.set_defaults(run=speed)
    command = commands.add_parser("run")
    for option in ("--build", "--tools"):
        command.add_argument(option, required=True)
    command.add_argument("command", nargs="+")
    command.set_defaults(run=in_a_run)
    command = commands.add_parser("instructions")
    command.add_argument("what", choices=("check", "update"))
    for option in ("--figures", "--target"):
        command.add_argument(option, required=True)
    command.add_argument("command", nargs="+")
    command.set_defaults(run=instructions)
    command = commands.add_parser("stack")
    command.add_argument("--ci", action="append", required=True)
    command.add_argument("--entry", required=True)
    command.add_argument("--limit", type=int)
    command.set_defaults(run=stack)
    args = parser.parse_args()
    try:
        return args.run(args)
    except Refused as reason:
        print(f"refused: {reason}")
        return 1


if __name__ == "__main__":
    sys.exit(main())
