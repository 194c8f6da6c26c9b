#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The command line teaches and is careful: every example of every --help runs as it stands there; push --dry-run shows what
would change and leaves the controller untouched; completion, colours, hints and bars behave on a terminal and in a pipe."""
import csv, json, math, os, pty, re, select, shutil, signal, socket, subprocess, sys, tempfile, time
work = tempfile.TemporaryDirectory()
os.chdir(work.name)
root = os.environ["FLEXCOMP_SOURCE_DIR"]
os.environ["PATH"] = os.environ["FLEXCOMP_BIN_DIR"] + ":" + os.environ["PATH"]
failures = 0

def fail(*words):
    global failures
    failures += 1
    print("FAILED:", *words)

def run(command, **more):
    r = subprocess.run(command, shell=isinstance(command, str), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                       executable="/bin/bash" if isinstance(command, str) else None, timeout=200, **more)
    return r.returncode, r.stdout, r.stderr

def done(command):
    code, said, warned = run(command)
    if code: fail(command, code, said, warned)
    return said

def on_terminal(command, **environment):
    """What a command writes to a terminal, both streams."""
    pid, fd = pty.fork()
    if pid == 0:
        env = dict(os.environ, TERM="xterm", **environment)
        os.execvpe(command[0], command, env)
    text = b""
    while True:
        try: piece = os.read(fd, 65536)
        except OSError: break
        if not piece: break
        text += piece
    os.waitpid(pid, 0)
    os.close(fd)
    return text.decode()

# --- files by the names that the examples use
robots, data = root + "/host/robots/", root + "/tests/data/"
shutil.copy(robots + "tx60l.yaml", "tx60l.yaml")
shutil.copy(data + "tx60l.urdf", "tx60l.urdf")
shutil.copy(data + "kuka_kr6_r900.urdf", "kr6.urdf")
shutil.copy(robots + "kuka-kr6-r900.yaml", "kr6.yaml")
shutil.copy(data + "tx60l_table1.yaml", "truth.yaml")
shutil.copy(root + "/docs/examples/cell.yaml", "cell.yaml")
done("flexcomp simulate --robot tx60l.yaml --truth truth.yaml --poses 60 --payloads 0,1.108 --context -o measured.csv")
done("flexcomp simulate --robot tx60l.yaml --truth truth.yaml --poses 40 --payloads 0,1.108 --context --seed 2 -o others.csv")
done("flexcomp identify --robot tx60l.yaml --data measured.csv -o cal.yaml --quiet")
shutil.copy("measured.csv", "q.csv"); shutil.copy("others.csv", "t.csv")
rows = list(csv.DictReader(open("measured.csv")))
with open("log.csv", "w") as f:
    f.write("point," + ",".join("q%d_deg" % j for j in range(1, 7)) + "\n")
    for k, r in enumerate(rows): f.write("P%d,%s\n" % (k, ",".join(r["q%d_deg" % j] for j in range(1, 7))))
with open("tracker.txt", "w") as f:
    f.write("// Units: mm\n// Collection::Group::Point X Y Z\n")
    for k, r in enumerate(rows): f.write("A::Poses::P%d %s %s %s\n" % (k, r["x_mm"], r["y_mm"], r["z_mm"]))
with open("map.yaml", "w") as f:
    f.write("name: point\njoints:\n" + "".join("  - {column: q%d_deg, unit: deg, sign: 1, offset_deg: 0}\n" % j for j in range(1, 7)))
# An arm that a controller corrects: the tracker's poses are those of the corrected commands, the joints those of the program.
done("flexcomp compensate --robot tx60l.yaml --calibration cal.yaml --targets others.csv -o corrected.csv --quiet")
wanted, driven = list(csv.DictReader(open("others.csv"))), list(csv.DictReader(open("corrected.csv")))
joints = ["q%d_deg" % j for j in range(1, 7)]
def table(name, rows):
    with open(name, "w") as f: f.write("\n".join([",".join(rows[0])] + [",".join(r.values()) for r in rows]) + "\n")
table("commands.csv", [{**w, **{q: d[q] for q in joints}} for w, d in zip(wanted, driven)])
done("flexcomp predict --robot tx60l.yaml --calibration truth.yaml --joints commands.csv -o there.csv --quiet")
pose = ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
table("driven.csv", [{**w, **{k: t[k] for k in pose}} for w, t in zip(wanted, csv.DictReader(open("there.csv")))])
def left(data):
    done("flexcomp validate --robot tx60l.yaml --calibration cal.yaml --data %s --corrected --json left.json --quiet" % data)
    return json.load(open("left.json"))["corrected"]["mean_mm"]
if not left("driven.csv") < 0.1 or not left("others.csv") > 1: fail("--corrected", left("driven.csv"), left("others.csv"))
open("kr6_cal.yaml", "w").write("geometric: [{link: 2, a_mm: 0.3, theta_deg: 0.02}]\n")
open("weld.src", "w").write("DEF WELD( )\nPTP {A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0}\nPTP {A1 10,A2 -80,A3 95,A4 5,A5 40,A6 20}\nEND\n")

# --- a controller
with socket.socket() as s:
    s.bind(("127.0.0.1", 0)); port = s.getsockname()[1]
controller = subprocess.Popen(["flexcomp-controller", "--robot", "tx60l.yaml", "--store", "slots.bin", "--modbus-tcp", "127.0.0.1:%d:1" % port],
                              stdout=subprocess.PIPE, text=True)
bus = "modbus-tcp:127.0.0.1:%d:1" % port
try:
    if "ready" not in controller.stdout.readline(): sys.exit("no controller")

    # --- push --dry-run
    def state():
        done("flexcomp status --of %s --json s.json --quiet" % bus)
        s = json.load(open("s.json"))
        for counter in ("cycles", "cycles_by_status", "last_status"): s.pop(counter)  # of the cycle, which goes on
        return s, open("slots.bin", "rb").read()
    before = state()
    said = done("flexcomp push --to %s --dry-run cal.yaml --json d.json" % bus)
    if state() != before: fail("a dry run changed the controller without a set", before[0], state()[0])
    if "holds no set" not in said or "Nothing was sent" not in said: fail(said)
    told = json.load(open("d.json"))
    cal = open("cal.yaml").read()
    if not told["dry_run"] or any(p["old"] != 0 for p in told["parameters"]) or len(told["parameters"]) < 30: fail(told)
    by_name = {p["name"]: p for p in told["parameters"]}
    wanted = float(re.search(r"\{link: 2,[^}]*?\ba_mm: ([-.\de]+)", cal).group(1))
    if abs(by_name["link2.a_mm"]["new"] - wanted) > 1e-9 or by_name["link2.a_mm"]["unit"] != "mm": fail(by_name["link2.a_mm"], wanted)
    # A change of a length moves the tool by just that, but for the bending of the arm that is then another.
    if abs(by_name["link2.a_mm"]["tool_mm"] - abs(wanted)) > 1e-3 * abs(wanted): fail("at the tool", by_name["link2.a_mm"])
    done("flexcomp push --to %s cal.yaml --quiet" % bus)
    done("flexcomp pull --from %s -o active.yaml --image active.bin --quiet" % bus)
    open("cal2.yaml", "w").write(re.sub(r"(\{link: 2,[^}]*?\ba_mm: )[-.\de]+", lambda m: m.group(1) + repr(wanted + 0.25), cal))
    before = state()
    said = done("flexcomp push --to %s --dry-run cal2.yaml --json d.json" % bus)
    if state() != before: fail("a dry run changed the controller", before[0], state()[0])
    done("flexcomp pull --from %s --image again.bin --quiet" % bus)
    if open("active.bin", "rb").read() != open("again.bin", "rb").read(): fail("the active set changed")
    told = json.load(open("d.json"))
    if [p["name"] for p in told["parameters"]] != ["link2.a_mm"]: fail(told)
    one = told["parameters"][0]
    if abs(one["old"] - wanted) > 1e-9 or abs(one["new"] - wanted - 0.25) > 1e-9 or abs(told["tool"]["largest_mm"] - 0.25) > 0.002: fail(told)
    bounds = told["certificate"]
    if not 10000 < bounds["instructions"] < 60000 or len(bounds["deflection_deg"]) != 6 or not 0.5 < bounds["position_mm"] < 100: fail(bounds)
    if "cost: at most %d instructions" % bounds["instructions"] not in said or "bounds: joints deflect by at most" not in said: fail(said)
    if "holds set 1" not in said or not re.search(r"link2\.a_mm .*->.* 0\.2500 ", said): fail(said)
    # The same against the pulled file and the pulled image, without a controller; the same set changes nothing.
    for file in ("active.yaml", "active.bin"):
        done("flexcomp push --dry-run --against %s --robot tx60l.yaml cal2.yaml --json e.json" % file)
        other = json.load(open("e.json"))
        if other["parameters"] != told["parameters"] or other["tool"] != told["tool"]: fail(file, other)
    if "0 change" not in done("flexcomp push --to %s --dry-run cal.yaml" % bus): fail("the same set")
    for bad, says in (("push --dry-run cal.yaml", "--to is required"), ("push --against active.yaml --to %s cal.yaml" % bus, "--dry-run"),
                      ("push --dry-run --confirm --to %s" % bus, "--dry-run"), ("push --dry-run --trial 3 --to %s cal.yaml" % bus, "--dry-run"),
                      ("push --dry-run --against active.yaml cal.yaml", "--robot"),
                      ("push --resume --confirm --to %s" % bus, "--resume"), ("push --resume --to %s" % bus, "CAL.yaml"),
                      ("push --resume --dry-run --to %s cal.yaml" % bus, "--resume"),
                      ("push --resume --sequence 7 --to %s cal.yaml" % bus, "--resume"),
                      ("push --dry-run --against active.yaml --to %s --robot tx60l.yaml cal.yaml" % bus, "no --to"),
                      ("pull --from %s -o p.yaml --image ./p.yaml" % bus, "another file"),
                      ("predict --robot tx60l.yaml --joints others.csv -o others.csv", "another file")):
        code, said, warned = run("flexcomp " + bad)
        if code != 2 or says not in warned: fail(bad, code, warned)
    # A file that is no image is refused as a file, with a controller as without one.
    open("cut.bin", "wb").write(open("active.bin", "rb").read()[:-9])
    for how in ("--to " + bus, "--against active.yaml --robot tx60l.yaml"):
        code, said, warned = run("flexcomp push %s --dry-run cut.bin" % how)
        if code != 3 or "cut.bin" not in warned or "more than" in warned: fail("a truncated image", how, code, warned)
    code, said, warned = run("flexcomp push --dry-run --against active.yaml --robot tx60l.yaml absent.yaml")
    if code != 3: fail(code, warned)

    # --- the examples
    commands = re.search(r"Subcommands:\n(.*)", done("flexcomp --help"), re.S).group(1)
    commands = re.findall(r"^  ([a-z]+) ", commands, re.M)
    if len(commands) < 20: fail("commands", commands)
    for status in "012345":
        if not re.search(r"Exit status:.*\b%s " % status, done("flexcomp --help"), re.S): fail("--help does not tell status", status)
    for command in ("simulate", "compensate"):
        if "Rot(z,rz) Rot(y,ry) Rot(x,rx)" not in " ".join(done("flexcomp %s --help" % command).split()): fail(command, "--frame")
    examples = 0
    for command in commands:
        text = done(["flexcomp", command, "--help"])
        purpose = text.split("\n")[0]
        if len(purpose) < 20: fail(command, "has no purpose:", purpose)
        lines = re.findall(r"^  ((?:source <\()?flexcomp .*)$", text, re.M)
        if not lines: fail(command, "--help has no example")
        for line in lines:
            if "/etc/" in line: continue
            if "flexcomp " + command not in line: fail("an example of another command:", line)
            # The controller of this test for the ones of the examples.
            line = re.sub(r"(can|modbus-tcp|modbus-rtu):\S+", bus, line)
            start = time.time()
            if command in ("rollback", "erase"): done("flexcomp push --to %s cal2.yaml --quiet" % bus)
            code, said, warned = run(line)
            examples += 1
            print("%5.1f s" % (time.time() - start), line)
            if code: fail(line, code, said, warned)
    print(examples, "examples of", len(commands), "commands")
finally:
    controller.send_signal(signal.SIGTERM)
    controller.wait(10)

# --- completion: a bash of its own sources it and asks
open("ask.sh", "w").write(r'''
source <(flexcomp completion bash) || exit 1
[[ $(complete -p flexcomp) == *_flexcomp* ]] || exit 2
ask() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=(); _flexcomp 2>/dev/null; echo "${COMPREPLY[*]}"; }
while IFS= read -r line; do IFS='|' read -ra words <<<"$line|"; ask "${words[@]}"; done
''')
os.mkdir("robots"); open("zz file.csv", "w").close()
asked = {"flexcomp|ident": "identify", "flexcomp|pu": "push pull", "flexcomp|identify|--mod": "--model",
         "flexcomp|identify|--model|": "full geometric no-gravity no-stiffness", "flexcomp|identify|--model|no-s": "no-stiffness",
         "flexcomp|identify|--robot|tx": "tx60l.yaml", "flexcomp|identify|--robot|rob": "robots", "flexcomp|identify|--data|zz": "zz file.csv",
         "flexcomp|study|fig": "fig2 fig3 fig4 fig8", "flexcomp|export|--as|": "c urdf eds modbus", "flexcomp|export|--urdf|kr": "kr6.urdf",
         "flexcomp|push|--dr": "--dry-run", "flexcomp|push|--key|arm": "arm.key arm.key.pub", "flexcomp|trust|ar": "arm.key.pub", "flexcomp|keyg": "keygen", "flexcomp|import|--delimiter|": "blanks comma semicolon tab", "flexcomp|import|--decimal|": "comma point",
         "flexcomp|identify|--model|=|no-s": "no-stiffness", "flexcomp|identify|--model|=": "full geometric no-gravity no-stiffness",
         "flexcomp|identify|--model=no-": "--model=no-gravity --model=no-stiffness", "flexcomp|identify|--robot=tx": "--robot=tx60l.yaml",
         "flexcomp|identify|--robot|=|tx": "tx60l.yaml", "flexcomp|completion|": "bash", "flexcomp|simulate|--poses|1": "", "flexcomp|nothing|-": ""}
r = subprocess.run(["bash", "--norc", "ask.sh"], input="\n".join(asked) + "\n", stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
got = r.stdout.split("\n")[:-1]
if r.returncode or len(got) != len(asked): fail("completion", r.returncode, r.stdout, r.stderr)
for (question, wanted), answer in zip(asked.items(), got):
    if sorted(answer.split(" ")) != sorted(wanted.split(" ")): fail("completion of", question, "gives", repr(answer), "not", repr(wanted))
# Whatever the tree has is offered: every option of every command's help.
for command in commands:
    options = set(re.findall(r"(?<![-\w])--[a-z][-a-z0-9]*", re.split(r"\nExamples?:", done(["flexcomp", command, "--help"]))[0].split("Options:", 1)[-1]))
    offered = set(subprocess.run(["bash", "--norc", "ask.sh"], input="flexcomp|%s|--\n" % command, stdout=subprocess.PIPE, text=True).stdout.split())
    missing = {o for o in re.findall(r"^  (?:-\w,)?(--[a-z][-a-z0-9]*)", done(["flexcomp", command, "--help"]), re.M)} - offered
    if missing or not offered: fail("completion of", command, "lacks", missing, offered)

# --- numbers: what takes one takes no nan, no inf and nothing beyond a double, in any command
def complaint(command, option, value):
    """What is said against this option: other options may be missing, which is said later."""
    code, said, warned = run(["flexcomp", command, "%s=%s" % (option, value)])
    return warned if code == 2 and re.search(r"(^|\s)%s: |= %s(\s|$)|%s = " % (option, re.escape(value), option), warned) else ""
numbers = set()
for command in commands:
    for option in re.findall(r"^  (?:-\w,)?(--[a-z][-a-z0-9]*) (?!Excludes:|Needs:)[A-Z]", done(["flexcomp", command, "--help"]), re.M):
        for good, wrong in (("1", "abc"), ("1,1,1,1,1,1", "1,1,abc,1,1,1")):
            if complaint(command, option, good) or not complaint(command, option, wrong): continue
            numbers.add((command, option))
            for bad in ("nan", "NaN", "inf", "-inf", "infinity", "1e999", "-1e999", "nan(1)"):
                if not complaint(command, option, wrong.replace("abc", bad)): fail(command, option, "takes", bad)
for known in (("import", "--tolerance"), ("import", "--time-shift"), ("import", "--coverage"), ("simulate", "--frame"), ("simulate", "--payloads"),
              ("compensate", "--start"), ("compensate", "--frame"), ("plan", "--effort"), ("plan", "--payloads"), ("push", "--trial"), ("status", "--timeout")):
    if known not in numbers: fail(known, "is not among the options that take numbers", numbers)
print(len(numbers), "options take numbers")
done(["flexcomp", "simulate", "--robot", "tx60l.yaml", "--truth", "truth.yaml", "--poses", "5", "--frame", "1500, -200, 300, 0, .5, 1e1", "-o", "frame.csv"])

# --- colour: on a terminal alone
validate = ["flexcomp", "validate", "--robot", "tx60l.yaml", "--calibration", "cal.yaml", "--data", "others.csv"]
plain = done(validate)
if "\x1b" in plain: fail("colour in a pipe")
shown = on_terminal(validate)
if "\x1b[32m" not in shown or "\x1b[1m" not in shown: fail("no colour on a terminal", repr(shown))
without = re.sub(r"\x1b\[[0-9;]*[mK]", "", shown).replace("\r\n", "\n")
if without.strip() != plain.strip(): fail("colour changes the text", repr(without), repr(plain))
for environment in ({"NO_COLOR": "1"}, {"TERM": "dumb"}):
    pid_text = on_terminal(["env", *("%s=%s" % e for e in environment.items()), *validate])
    if "\x1b" in pid_text: fail("colour with", environment)
if "\x1b[31m" not in on_terminal(["flexcomp", "validate", "--robot", "none.yaml", "--calibration", "cal.yaml", "--data", "x.csv"]): fail("errors are not red")

# --- bars: over a second, on a terminal, and taken away
plan = ["flexcomp", "plan", "--robot", "tx60l.yaml", "--cell", "cell.yaml", "--poses", "20", "--measure", "reflectors", "-o", "plan.csv"]
start = time.time()
shown = on_terminal(plan)
if time.time() - start > 2 and not re.search(r"\[[# ]{30}\] \d+ of \d+", shown): fail("no bar in", time.time() - start, "s", repr(shown[:300]))
code, said, warned = run(plan)
if "[#" in said + warned or "\r" in said + warned: fail("a bar in a pipe")

# --- hints
open("reflectors.txt", "w").write("// Units: mm\nA::P0_a 1 2 3\nA::P0_b 1 2 4\nA::P0_c 1 3 3\n")
for command, status, says in (
        ("flexcomp identfy --robot x", 2, 'did you mean "flexcomp identify"'),
        ("flexcomp", 2, '"flexcomp --help" lists'),
        ("flexcomp identify --robto tx60l.yaml --data measured.csv -o x.yaml", 2, "did you mean --robot"),
        ("flexcomp identify --data measured.csv -o x.yaml", 2, '"flexcomp identify --help"'),
        ("flexcomp identify --robot tx60.yaml --data measured.csv -o x.yaml", 3, "hint: there is tx60l.yaml"),
        ("flexcomp identify --robot tx60l.yaml --data log.csv -o x.yaml", 3, "flexcomp import --joints"),
        ("flexcomp import tracker.txt -o x.yaml", 3, "--joints LOG.csv"),
        ("flexcomp import reflectors.txt --joints log.csv --robot tx60l.yaml -o x.csv", 3, "{pose}_{reflector}"),
        ("flexcomp status --of modbus-tcp:127.0.0.1:%d:1" % port, 4, "reachable"),
        ("flexcomp status --of can:nocan9:3", 4, "hint: "),
        ("flexcomp validate --robot tx60l.yaml --calibration cal.yaml --data slipped.csv", 5, "flexcomp diagnose")):
    if "slipped" in command:
        with open("slipped.csv", "w") as f:
            names = list(rows[0])
            f.write(",".join(names) + "\n")
            for k, r in enumerate(csv.DictReader(open("others.csv"))):
                f.write(",".join(str(float(r[c]) + (0.3 * math.sin(7 * k) if c == "x_mm" else 0)) for c in names) + "\n")
    code, said, warned = run(command)
    if code != status or says not in warned: fail(command, code, warned)
    if not any(l.startswith("hint: ") for l in warned.split("\n")): fail("no hint:", warned)
# No advice is better than a wrong one: what this very command does, a file that is called quite otherwise.
shutil.copy("tx60l.yaml", "worn.yaml")
for command, never in (("flexcomp import tracker.txt --joints log.csv --joint-columns q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6 --robot tx60l.yaml -o x.csv", "flexcomp import"),
                       ("flexcomp identify --robot nope.yaml --data measured.csv -o x.yaml", "there is"),
                       ("flexcomp identify --robot tx60l.yaml --data q.txt -o x.yaml", "there is t")):
    code, said, warned = run(command)
    if code != 3 or never in warned: fail(command, code, warned)
for wrong, right in (("tx60.yaml", "tx60l.yaml"), ("tx60l.yml", "tx60l.yaml"), ("wron.yaml", "worn.yaml")):
    code, said, warned = run("flexcomp identify --robot %s --data measured.csv -o x.yaml" % wrong)
    if code != 3 or "there is " + right not in warned: fail(wrong, code, warned)
for wrong in ("frob", "plann --robot tx60l.yaml"):
    code, said, warned = run("flexcomp " + wrong)
    if code != 2 or '"%s" is no command' % wrong.split()[0] not in warned: fail(wrong, code, warned)
# Where a message cannot be written the exit status says it alone, and no output file takes the place of the stream.
for command, status in (("flexcomp identify --robot nix.yaml --data measured.csv -o x.yaml", 3), ("flexcomp status --of foo", 2),
                        ("flexcomp validate --robot tx60l.yaml --calibration cal.yaml --data slipped.csv --json closed.json", 5)):
    for stream in ("2>/dev/full", "2>&-"):
        code, said, warned = run(command + " " + stream)
        if code != status: fail(command, stream, code)
json.load(open("closed.json"))
print(failures, "failures")
sys.exit(failures != 0)
