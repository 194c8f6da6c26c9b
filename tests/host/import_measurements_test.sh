#!/usr/bin/env bash
# flexcomp import of instruments' exports: the same measured data in the dress of SpatialAnalyzer, PolyWorks, a spreadsheet
# with decimal commas, metres, inches, radians, other signs and zeros, clocks … becomes the same data file again; what is
# ambiguous, undeclared or contradictory is refused with file, line and field.
set -uo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
/usr/bin/python3 - "${FLEXCOMP_BIN_DIR:?}/flexcomp" "${FLEXCOMP_SOURCE_DIR:?}" <<'PYTHON'
import csv, json, math, os, random, subprocess, sys
flexcomp, root = sys.argv[1:]
robot = root + "/host/robots/tx60l.yaml"
truth = root + "/tests/data/tx60l_table1.yaml"
failures = 0

def run(*arguments):
    r = subprocess.run([flexcomp, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    return r.returncode, r.stdout, r.stderr

def fail(*words):
    global failures
    failures += 1
    print("FAILED:", *words)

def write(path, text, encoding="utf-8"):
    with open(path, "w", encoding=encoding, newline="") as f: f.write(text)

def rows(path):
    with open(path, newline="") as f: return list(csv.DictReader(f))

def same(path, wanted, columns, tolerance=1e-9):
    have = rows(path)
    if len(have) != len(wanted): return fail(path, "has", len(have), "rows, expected", len(wanted))
    for k, (a, b) in enumerate(zip(have, wanted)):
        for c in columns:
            if c not in a: return fail(path, "lacks", c, list(a))
            if abs(float(a[c]) - float(b[c])) > tolerance: return fail(path, "row", k, c, a[c], "is not", b[c])

def imports(points, log, *more, out="out.csv", says=()):
    code, said, warned = run("import", points, "--joints", log, "--robot", robot, "-o", out, "--json", "out.json", *more)
    if code != 0: fail("import", points, log, *more, "gives", code, said, warned)
    for s in says:
        if s not in said + warned: fail("import", points, *more, "does not say", repr(s), ":", said, warned)
    return json.load(open("out.json")) if code == 0 else {}

def refuses(points, log, *more, says=(), code=3):
    if os.path.exists("no.csv"): os.remove("no.csv")
    got, said, warned = run("import", points, "--joints", log, "--robot", robot, "-o", "no.csv", *more)
    if got != code: fail("import", points, log, *more, "gives", got, "instead of", code, said, warned)
    for s in says:
        if s not in warned: fail("import", points, *more, "does not say", repr(s), ":", warned)
    left = [f for f in os.listdir(".") if f.startswith("no.csv")]
    if left: fail("a refused import leaves", left)

for kind in ("position", "pose", "reflectors"):
    code, _, e = run("simulate", "--robot", robot, "--truth", truth, "--poses", "40", "--measure", kind, "--noise", "N1",
                     "--frame", "1500,-200,300,10,20,30", "-o", kind + ".csv", "--quiet")
    if code: sys.exit(e)
q = ["q%d_deg" % j for j in range(1, 7)]
xyz = ["x_mm", "y_mm", "z_mm"]
data = rows("position.csv")
n = len(data)
names = ["P%02d" % (k + 1) for k in range(n)]

# --- the robot's log, plainly and as others write it
write("log.csv", "point," + ",".join(q) + "\n" + "".join("%s,%s\n" % (m, ",".join(r[c] for c in q)) for m, r in zip(names, data)))

# SpatialAnalyzer: comments with the unit, one name of three parts, blanks.
shuffled = list(range(n))
random.Random(3).shuffle(shuffled)
write("sa.txt", "// SpatialAnalyzer export\n// Units: Millimeters, Degrees\n// Frame: A::WORLD\n// Collection::Group::Point X Y Z\n" +
      "".join("A::Poses::%s   %s  %s  %s\r\n" % (names[k], *(data[k][c] for c in xyz)) for k in shuffled))
told = imports("sa.txt", "log.csv", says=("40 rows", "in mm", "by name"))
same("out.csv", [data[k] for k in shuffled], q + xyz)
if told.get("unit") != "mm" or told.get("rows") != n: fail("json", told)
if [r["point"] for r in rows("out.csv")] != ["A::Poses::" + names[k] for k in shuffled]: fail("names are not passed through")
# … and comma-parted with the parts of the name in columns of their own, no header at all.
write("sa.csv", "// Units: mm\n" + "".join("A, Poses, %s, %s, %s, %s\n" % (names[k], *(data[k][c] for c in xyz)) for k in range(n)))
imports("sa.csv", "log.csv")
same("out.csv", data, q + xyz)

# PolyWorks: semicolons, decimal comma, nominal, measured and deviation beside each other, unit in the names, uncertainty in µm.
comma = lambda v: ("%.9f" % float(v)).replace(".", ",")
write("pw.csv", "\ufeffName;Nominal X [mm];Nominal Y [mm];Nominal Z [mm];Measured X [mm];Measured Y [mm];Measured Z [mm];Deviation X;"
      "Ux [µm];Uy [µm];Uz [µm];Comment\r\n" +
      "".join("%s;0,0;0,0;0,0;%s;%s;%s;0,5;30;40;%s;\"of; gate 2\"\r\n" % (m, *(comma(r[c]) for c in xyz), "50") for m, r in zip(names, data)))
told = imports("pw.csv", "log.csv", says=("semicolon, decimal comma", "not read: Nominal X [mm]", "Comment"))
same("out.csv", [dict(r, sigma_mm=str(math.sqrt((30**2 + 40**2 + 50**2) / 3) / 1000)) for r in data], q + xyz + ["sigma_mm"])
if "Deviation X" not in told["columns_not_read"] or not told["sigma"]: fail(told)
imports("pw.csv", "log.csv", "--coverage", "2")
same("out.csv", [dict(r, sigma_mm=str(math.sqrt((30**2 + 40**2 + 50**2) / 3) / 2000)) for r in data], ["sigma_mm"])
# Identified from it: the same calibration as from our own file with that noise.
imports("pw.csv", "log.csv", out="pw_data.csv")
own = rows("pw_data.csv")
write("own.csv", ",".join(q + xyz + ["sigma_mm"]) + "\n" + "".join(",".join([data[k][c] for c in q + xyz] + [own[k]["sigma_mm"]]) + "\n" for k in range(n)))
for f in ("pw_data", "own"):
    code, said, e = run("identify", "--robot", robot, "--data", f + ".csv", "--model", "geometric", "-o", f + ".yaml", "--json", f + ".json")
    if "has no meaning here" in e: fail("the points' names are warned of", e)
a, b = (json.load(open(f + ".json"))["after"]["mean_mm"] for f in ("pw_data", "own"))
if abs(a - b) > 1e-6: fail("identify differs:", a, b)

# Decimal comma with blanks and tabs, metres by option, quoted cells with commas inside.
metres = lambda v: ("%.12f" % (float(v) / 1000)).replace(".", ",")
for gap in (" ", "\t"):
    write("m.txt", "".join(gap.join([m] + [metres(r[c]) for c in xyz]) + "\n" for m, r in zip(names, data)))
    imports("m.txt", "log.csv", "--unit", "m", says=("points in m", "decimal comma"))
    same("out.csv", data, q + xyz)
write("quoted.csv", '"Name","X","Y","Z"\n' + "".join('"%s","%s","%s","%s"\n' % (m, *(comma(r[c]) for c in xyz)) for m, r in zip(names, data)))
imports("quoted.csv", "log.csv", "--unit", "mm")
same("out.csv", data, q + xyz)
write("inch.txt", "Units are in inches\nname x y z\n" + "".join("%s %.12f %.12f %.12f\n" % (m, *(float(r[c]) / 25.4 for c in xyz)) for m, r in zip(names, data)))
imports("inch.txt", "log.csv")
same("out.csv", data, q + xyz)
# Without header, columns by option.
write("bare.txt", "".join("%s %d %s %s %s 7.5\n" % (m, k, *(r[c] for c in xyz)) for k, (m, r) in enumerate(zip(names, data))))
imports("bare.txt", "log.csv", "--columns", "name,-,x,y,z,-", "--unit", "mm")
same("out.csv", data, q + xyz)

# --- 6-D: quaternions, fixed and moving angles, rotation vectors, KUKA's A B C
poses = rows("pose.csv")
quat = ["qw", "qx", "qy", "qz"]
write("log6.csv", "name;" + ";".join("A%d [rad]" % j for j in range(1, 7)) + "\n" +
      "".join("%s;%s\n" % (m, ";".join(("%.15f" % math.radians(float(r[c]))).replace(".", ",") for c in q)) for m, r in zip(names, poses)))
def matrix(r):
    w, x, y, z = (float(r[c]) for c in quat)
    return [[1-2*(y*y+z*z), 2*(x*y-w*z), 2*(x*z+w*y)], [2*(x*y+w*z), 1-2*(x*x+z*z), 2*(y*z-w*x)], [2*(x*z-w*y), 2*(y*z+w*x), 1-2*(x*x+y*y)]]
def fixed(m): return math.atan2(m[2][1], m[2][2]), math.asin(max(-1, min(1, -m[2][0]))), math.atan2(m[1][0], m[0][0])
def moving(m): return math.atan2(-m[1][2], m[2][2]), math.asin(max(-1, min(1, m[0][2]))), math.atan2(-m[0][1], m[0][0])
def vector(r):
    w, x, y, z = (float(r[c]) for c in quat)
    s = math.sqrt(x*x+y*y+z*z); a = 2 * math.atan2(s, w)
    return x/s*a, y/s*a, z/s*a
def six(head, three):
    write("six.csv", head + "\n" + "".join("%s,%s,%s\n" % (m, ",".join(r[c] for c in xyz), ",".join("%.14f" % v for v in three(r))) for m, r in zip(names, poses)))
write("quat.csv", "name,x [mm],y [mm],z [mm],qw,qx,qy,qz\n" + "".join("%s,%s\n" % (m, ",".join(r[c] for c in xyz + quat)) for m, r in zip(names, poses)))
imports("quat.csv", "log6.csv", says=("full poses",))
same("out.csv", poses, q + xyz + quat, 1e-8)
six("name,x_mm,y_mm,z_mm,rx_rad,ry_rad,rz_rad", lambda r: fixed(matrix(r)))
imports("six.csv", "log6.csv", "--angles", "fixed-xyz")
same("out.csv", poses, q + xyz + quat, 1e-7)
refuses("six.csv", "log6.csv", says=("six.csv:1", "--angles fixed-xyz"))
six("name,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg", lambda r: map(math.degrees, moving(matrix(r))))
imports("six.csv", "log6.csv", "--angles", "moving-xyz")
same("out.csv", poses, xyz + quat, 1e-7)
six("name,x_mm,y_mm,z_mm,rx,ry,rz", vector)
refuses("six.csv", "log6.csv", "--angles", "rotation-vector", says=("--angle-unit", "angle"))
imports("six.csv", "log6.csv", "--angles", "rotation-vector", "--angle-unit", "rad")
same("out.csv", poses, xyz + quat, 1e-7)
six("name,x_mm,y_mm,z_mm,a_deg,b_deg,c_deg", lambda r: [math.degrees(v) for v in reversed(fixed(matrix(r)))])
imports("six.csv", "log6.csv")
same("out.csv", poses, xyz + quat, 1e-7)
write("badq.csv", open("quat.csv").read().replace(poses[4]["qw"], "2", 1))
refuses("badq.csv", "log6.csv", says=("badq.csv:6", "norm"))

# --- reflectors: by pattern and by order
ref = rows("reflectors.csv")
write("logr.csv", "pose," + ",".join(q) + "\n" + "".join("%s,%s\n" % (m, ",".join(r[c] for c in q)) for m, r in zip(names, ref)))
four = [(m, letter, [r[letter.lower() + axis + "_mm"] for axis in "xyz"]) for m, r in zip(names, ref) for letter in "ABCD"]
mixed = list(four); random.Random(5).shuffle(mixed)
points = [c + a + "_mm" for c in "abcd" for a in "xyz"]
write("refl.txt", "// Units: mm\n" + "".join("Cell::Day1::%s_%s %s %s %s\n" % (m, l, *v) for m, l, v in mixed))
told = imports("refl.txt", "logr.csv", "--names", "*::{pose}_{reflector}", says=("reflector points",))
by_name = {r["point"]: r for r in rows("out.csv")}
same("out.csv", [ref[names.index(r["point"])] for r in rows("out.csv")], q + points)
write("refl_order.txt", "".join("%s %s %s\n" % tuple(v) for m, l, v in four))
imports("refl_order.txt", "logr.csv", "--join", "order", "--reflectors", "4", "--unit", "mm")
same("out.csv", ref, q + points)
refuses("refl_order.txt", "logr.csv", "--join", "order", "--reflectors", "3", "--unit", "mm", says=("120 points", "160"))
refuses("refl_order.txt", "logr.csv", "--unit", "mm", says=("--join", "order or time"))
# One reflector of a pose was not seen: that pose is listed, the others are data.
write("hole.txt", "// Units: mm\n" + "".join("Cell::%s_%s %s %s %s\n" % (m, l, *v) for m, l, v in four if (m, l) != ("P07", "C")) + "Cell::base1 1 2 3\n")
told = imports("hole.txt", "logr.csv", "--names", "*::{pose}_{reflector}", says=("P07", "without reflector c", "base1", "a name of another kind"))
if told["rows"] != 39 or len(told["points_without_joints"]) != 2 or told["joints_without_point"] != ["P07 (line 8)"]: fail(told)

# --- who has no partner is listed
few = [l for l in open("log.csv") if not l.startswith(("P03", "P11"))]
write("few.csv", "".join(few) + "Q1," + ",".join(data[0][c] for c in q) + "\n")
told = imports("sa.txt", "few.csv", says=("2: points of sa.txt without joint readings", "P03", "P11", "Q1 (line 40)"))
if told["rows"] != 38 or len(told["points_without_joints"]) != 2 or len(told["joints_without_point"]) != 1: fail(told)
write("nobody.csv", open("log.csv").read().replace("\nP", "\nR"))
refuses("sa.txt", "nobody.csv", says=("none with a partner", "R01"))

# --- names twice
write("twice.txt", open("sa.txt").read() + "A::Poses::P05 1 2 3\n")
refuses("twice.txt", "log.csv", says=("twice.txt:45", "--repeats"))
told = imports("twice.txt", "log.csv", "--repeats")
if told["rows"] != 41: fail(told)
write("twice.csv", open("log.csv").read() + "P05," + ",".join(data[0][c] for c in q) + "\n")
refuses("sa.txt", "twice.csv", says=("twice.csv:42", "line 6"))

# --- a map: other names, signs, zeros, units, context, a clock
offset = [0, 90, -90, 0, 0, 10]
sign = [1, -1, 1, 1, -1, 1]
def foreign(r, j):  # column = sign * (q - offset)
    v = sign[j] * (float(r[q[j]]) - offset[j])
    return math.radians(v) if j == 2 else v
base = 1772000000
moments = [2.0 * k + 0.1 * ((7 * k) % 5) for k in range(n)]
import datetime
iso = lambda t: datetime.datetime.fromtimestamp(base + t, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%S.%f")
def log_text(times, extra=""):
    return "Roboter;Zelle 3\n" + "Zeit;" + ";".join("Achse_%d" % j for j in range(1, 7)) + ";Last\n" + "".join(
        "%s;%s;%s\n" % (t, ";".join(("%.13f" % foreign(data[k], j)).replace(".", ",") for j in range(6)), "1,108" if k % 2 else "0") for k, t in times) + extra
write("map.yaml", "delimiter: ';'\ntime: Zeit\njoints:\n" + "".join(
    "  - {column: Achse_%d, unit: %s, sign: %d, offset_deg: %g}\n" % (j + 1, "rad" if j == 2 else "deg", sign[j], offset[j]) for j in range(6)) +
    "context: {payload_kg: Last}\n")
# A log at 10 Hz while the arm stands still at each pose; the tracker's clock is 5 s behind.
ten_hertz = [(k, iso(m + d / 10)) for k, m in enumerate(moments) for d in range(-4, 5)]
write("robot.log", log_text(ten_hertz))
write("timed.csv", "Timestamp,X [mm],Y [mm],Z [mm]\n" + "".join("%sZ,%s\n" % (iso(m - 5 + 0.03), ",".join(r[c] for c in xyz)) for m, r in zip(moments, data)))
told = imports("timed.csv", "robot.log", "--map", "map.yaml", "--join", "time", "--time-shift", "5", "--tolerance", "0.2", says=("by time",))
same("out.csv", [dict(r, payload_kg="1.108" if k % 2 else "0") for k, r in enumerate(data)], q + xyz + ["payload_kg"], 1e-8)
if [round(float(r["time_s"]), 3) for r in rows("out.csv")][1] != round(moments[1] + 0.4, 3): fail("time_s", rows("out.csv")[1])
# Too wide a tolerance takes in the next pose: the arm was moving.
refuses("timed.csv", "robot.log", "--map", "map.yaml", "--join", "time", "--time-shift", "5", "--tolerance", "1.9", says=("timed.csv:2", "stands still", "joint"))
# A point at which the log has nothing is listed, not joined to the nearest.
write("late.csv", open("timed.csv").read() + "%sZ,1,2,3\n" % iso(500))
told = imports("late.csv", "robot.log", "--map", "map.yaml", "--join", "time", "--time-shift", "5", "--tolerance", "0.2", says=("1: points of late.csv", "line 42"))
write("counted.csv", "time_s,x_mm,y_mm,z_mm\n1.0,1,2,3\n")
refuses("counted.csv", "robot.log", "--map", "map.yaml", "--join", "time", says=("counted.csv:2", "dates with times", "seconds from a start"))
refuses("timed.csv", "log.csv", "--join", "time", says=("log.csv", "a column with times"))

# --- the log: no unit, not there, beyond the limits, radians under the name of degrees, map faults
write("nounit.csv", open("log.csv").read().replace("_deg", ""))
refuses("sa.txt", "nounit.csv", says=("nounit.csv:1", "q1", "--joint-unit"))
imports("sa.txt", "nounit.csv", "--joint-unit", "deg")
refuses("sa.txt", "log.csv", "--joint-unit", "rad", says=("--joint-unit", "deg"))
write("named.csv", open("log.csv").read().replace("q1_deg", "base axis"))
refuses("sa.txt", "named.csv", says=("named.csv:1", "--map"))
imports("sa.txt", "named.csv", "--joint-columns", "base axis,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg", "--joint-unit", "deg")
refuses("sa.txt", "named.csv", "--joint-columns", "bas axis,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg", says=("'base axis'",))
bad = open("log.csv").read().split("\n"); bad[4] = "P04,0,500,0,0,0,0"
write("beyond.csv", "\n".join(bad))
refuses("sa.txt", "beyond.csv", says=("beyond.csv:5", "q2_deg", "limits of joint 2"))
write("radians.csv", "point," + ",".join(q) + "\n" + "".join("%s,%s\n" % (m, ",".join("%.9f" % math.radians(float(r[c])) for c in q)) for m, r in zip(names, data)))
refuses("sa.txt", "radians.csv", says=("radians.csv", "look like radians"))
for bad, says in (("joints: [1, 2]", "six joints"), ("time: {column: t, unit: h}", "s, ms or us"), ("delimiter: '|'", "delimiter"),
                  ("context: {payload_k: t}", "payload_kg"), ("jonits: []", "did you mean 'joints'"), ("joints: 3", "a list")):
    write("bad.yaml", bad + "\n")
    refuses("sa.txt", "log.csv", "--map", "bad.yaml", says=("bad.yaml:1", says))
refuses("sa.txt", "log.csv", "--map", "map.yaml", says=("log.csv",))
refuses("sa.txt", "log.csv", "--map", "map.yaml", "--joint-columns", "a,b,c,d,e,f", code=2, says=("--map",))

# --- the points: what cannot be known or is wrong
body = "".join("%s %s %s %s\n" % (m, *(r[c] for c in xyz)) for m, r in zip(names, data))
write("bare2.txt", body)
refuses("bare2.txt", "log.csv", says=("bare2.txt:1", "--unit", "none"))
refuses("sa.txt", "log.csv", "--unit", "m", says=("--unit", "mm"))
write("two_units.txt", "// Units: mm\n// Units: inches\n" + body)
refuses("two_units.txt", "log.csv", says=("two_units.txt:2", "same units"))
write("mixed_units.csv", "name,x [mm],y [m],z [mm]\nP01,1,2,3\n")
refuses("mixed_units.csv", "log.csv", says=("mixed_units.csv:1", "y [m]"))
lines = body.split("\n")
lines[9] = lines[9].replace(" ", " ,", 1) + " 5"
write("long.txt", "\n".join(lines))
refuses("long.txt", "log.csv", "--unit", "mm", says=("long.txt:10",))
write("text.csv", "name,x_mm,y_mm,z_mm\nP01,1,2,3\nP02,1,---,3\n")
refuses("text.csv", "log.csv", says=("text.csv:3", "y_mm", "'---'"))
write("cell.csv", "name,x_mm,y_mm,z_mm\nP01,1,2,3\nP02,1,,3\n")
refuses("cell.csv", "log.csv", says=("cell.csv:3", "y_mm", "an empty field"))
write("marks.csv", "name;x_mm;y_mm;z_mm\nP01;1,5;2,5;3,5\nP02;1,5;2.5;3,5\n")
refuses("marks.csv", "log.csv", says=("marks.csv:3", "y_mm", "'2.5'"))
write("thousands.csv", "name;x_mm;y_mm;z_mm\nP01;1.500,5;2,5;3,5\n")
refuses("thousands.csv", "log.csv", says=("thousands.csv:2", "'1.500,5'"))
write("which.csv", "P01,1,5,2,5,3,5\n")
refuses("which.csv", "log.csv", "--unit", "mm", says=("which.csv:1", "--columns"))
write("short.csv", "name,x_mm,y_mm,z_mm\nP01,1,5,2,5,3,5\n")
refuses("short.csv", "log.csv", says=("short.csv:2", "4 fields", "7"))
write("two_x.csv", "name,x_mm,y_mm,z_mm,measured x_mm\nP01,1,2,3,4\n")
refuses("two_x.csv", "log.csv", says=("two_x.csv:1", "--columns"))
write("nothing.txt", "// only words\n")
refuses("nothing.txt", "log.csv", says=("nothing.txt",))
write("utf16.txt", "name x y z\nP01 1 2 3\n", "utf-16")
refuses("utf16.txt", "log.csv", says=("utf16.txt", "UTF-8"))
refuses("absent.txt", "log.csv", says=("absent.txt", "can be read"))
refuses("sa.txt", "absent.csv", says=("absent.csv", "can be read"))
refuses("sa.txt", "log.csv", "--columns", "nam,x,y,z", says=("did you mean 'name'",))
refuses("refl.txt", "logr.csv", "--names", "{reflector}", says=("{pose}",))
code, said, warned = run("import", "sa.txt", "--joints", "log.csv", "-o", "no.csv")
if code != 2 or "--robot" not in warned: fail("without --robot:", code, warned)

# Whatever becomes of an export: data, or a refusal that names it.
taken = 0
source = open("pw.csv", encoding="utf-8").read()
dice = random.Random(9)
for k in range(150):
    text = source
    for _ in range(dice.randint(1, 3)):
        at = dice.randrange(len(text))
        how = dice.randrange(4)
        if how == 0: text = text[:at] + dice.choice(";,.\t \"\n-x9") + text[at + 1:]
        elif how == 1: text = text[:at] + text[at + dice.randint(1, 30):]
        elif how == 2: text = text[:at] + text[at // 2:at // 2 + dice.randint(1, 40)] + text[at:]
        else: text = text[:at]
    write("broken.csv", text)
    code, said, warned = run("import", "broken.csv", "--joints", "log.csv", "--robot", robot, "-o", "maybe.csv", "--quiet")
    taken += code == 0
    if code not in (0, 3): fail("a broken export ends with", code, warned)
    if code == 3 and "broken.csv" not in warned and "log.csv" not in warned: fail("no file in", warned)
print(taken, "of 150 broken exports were still read")
if not 5 < taken < 145: fail("broken exports:", taken)
print(failures, "failures")
sys.exit(failures != 0)
PYTHON
