#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""flexcomp import of instruments' exports: the same measured data in the dress of SpatialAnalyzer, PolyWorks, a spreadsheet
with decimal commas, metres, inches, radians, other signs and zeros, clocks … becomes the same data file again; what is
ambiguous, undeclared or contradictory is refused with file, line and field."""
import json, math, os, random, re, sys
from command import fail, finish, matrix, q, quat, read, root, rows, run, write, xyz
robot = root + "/host/robots/tx60l.yaml"
truth = root + "/tests/data/tx60l_table1.yaml"
def same(path, wanted, columns, tolerance=1e-9):
    have = rows(path)
    if len(have) != len(wanted): return fail(path, "has", len(have), "rows, expected", len(wanted))
    for k, (a, b) in enumerate(zip(have, wanted)):
        for c in columns:
            if c not in a: return fail(path, "lacks", c, list(a))
            if abs(float(a[c]) - float(b[c])) > tolerance: return fail(path, "row", k, c, a[c], "is not", b[c])

def imports(points, log, *more, out="out.csv", says=(), gives=None, columns=q + xyz, tolerance=1e-9):
    code, said, warned = run("import", points, "--joints", log, "--robot", robot, "-o", out, "--json", "out.json", *more)
    if code != 0: fail("import", points, log, *more, "gives", code, said, warned)
    for s in says:
        if s not in said + warned: fail("import", points, *more, "does not say", repr(s), ":", said, warned)
    if gives is not None: same(out, gives, columns, tolerance)
    return json.load(open("out.json")) if code == 0 else {}

def refuses(points, log, *more, says=(), code=3):
    if os.path.exists("no.csv"): os.remove("no.csv")
    got, said, warned = run("import", points, "--joints", log, "--robot", robot, "-o", "no.csv", *more)
    if got != code: fail("import", points, log, *more, "gives", got, "instead of", code, said, warned)
    for s in says:
        if s not in warned: fail("import", points, *more, "does not say", repr(s), ":", warned)
    left = [f for f in os.listdir(".") if f.startswith("no.csv")]
    if left: fail("a refused import leaves", left)

def refuses_points(name, text, *more, says):
    write(name, text)
    refuses(name, "log.csv", *more, says=says)

def refuses_log(name, text, *more, says):
    write(name, text)
    refuses("sa.txt", name, *more, says=says)

for kind in ("position", "pose", "reflectors"):
    code, _, e = run("simulate", "--robot", robot, "--truth", truth, "--poses", "40", "--measure", kind, "--noise", "N1",
                     "--frame", "1500,-200,300,10,20,30", "-o", kind + ".csv", "--quiet")
    if code: sys.exit(e)
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
told = imports("sa.txt", "log.csv", says=("40 rows", "in mm", "by name"), gives=[data[k] for k in shuffled])
if told.get("unit") != "mm" or told.get("rows") != n: fail("json", told)
if [r["point"] for r in rows("out.csv")] != ["A::Poses::" + names[k] for k in shuffled]: fail("names are not passed through")
# … and comma-parted with the parts of the name in columns of their own, no header at all.
write("sa.csv", "// Units: mm\n" + "".join("A, Poses, %s, %s, %s, %s\n" % (names[k], *(data[k][c] for c in xyz)) for k in range(n)))
imports("sa.csv", "log.csv", gives=data)

# PolyWorks: semicolons, decimal comma, nominal, measured and deviation beside each other, unit in the names, uncertainty in µm.
comma = lambda v: ("%.9f" % float(v)).replace(".", ",")
write("pw.csv", "\ufeffName;Nominal X [mm];Nominal Y [mm];Nominal Z [mm];Measured X [mm];Measured Y [mm];Measured Z [mm];Deviation X;"
      "Ux [µm];Uy [µm];Uz [µm];Comment\r\n" +
      "".join("%s;0,0;0,0;0,0;%s;%s;%s;0,5;30;40;%s;\"of; gate 2\"\r\n" % (m, *(comma(r[c]) for c in xyz), "50") for m, r in zip(names, data)))
told = imports("pw.csv", "log.csv", says=("semicolon, decimal comma", "not read: Nominal X [mm]", "Comment"),
               gives=[dict(r, sigma_mm=str(math.sqrt((30**2 + 40**2 + 50**2) / 3) / 1000)) for r in data], columns=q + xyz + ["sigma_mm"])
if "Deviation X" not in told["columns_not_read"] or not told["sigma"]: fail(told)
imports("pw.csv", "log.csv", "--coverage", "2", gives=[dict(r, sigma_mm=str(math.sqrt((30**2 + 40**2 + 50**2) / 3) / 2000)) for r in data], columns=["sigma_mm"])
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
    imports("m.txt", "log.csv", "--unit", "m", says=("points in m", "decimal comma"), gives=data)
write("quoted.csv", '"Name","X","Y","Z"\n' + "".join('"%s","%s","%s","%s"\n' % (m, *(comma(r[c]) for c in xyz)) for m, r in zip(names, data)))
imports("quoted.csv", "log.csv", "--unit", "mm", gives=data)
write("inch.txt", "Units are in inches\nname x y z\n" + "".join("%s %.12f %.12f %.12f\n" % (m, *(float(r[c]) / 25.4 for c in xyz)) for m, r in zip(names, data)))
imports("inch.txt", "log.csv", gives=data)
# Without header, columns by option.
write("bare.txt", "".join("%s %d %s %s %s 7.5\n" % (m, k, *(r[c] for c in xyz)) for k, (m, r) in enumerate(zip(names, data))))
imports("bare.txt", "log.csv", "--columns", "name,-,x,y,z,-", "--unit", "mm", gives=data)

# --- 6-D: quaternions, fixed and moving angles, rotation vectors, KUKA's A B C
poses = rows("pose.csv")
write("log6.csv", "name;" + ";".join("A%d [rad]" % j for j in range(1, 7)) + "\n" +
      "".join("%s;%s\n" % (m, ";".join(("%.15f" % math.radians(float(r[c]))).replace(".", ",") for c in q)) for m, r in zip(names, poses)))
def turned(r): return matrix(*(float(r[c]) for c in quat))
def fixed(m): return math.atan2(m[2][1], m[2][2]), math.asin(max(-1, min(1, -m[2][0]))), math.atan2(m[1][0], m[0][0])
def moving(m): return math.atan2(-m[1][2], m[2][2]), math.asin(max(-1, min(1, m[0][2]))), math.atan2(-m[0][1], m[0][0])
def vector(r):
    w, x, y, z = (float(r[c]) for c in quat)
    s = math.sqrt(x*x+y*y+z*z); a = 2 * math.atan2(s, w)
    return x/s*a, y/s*a, z/s*a
def six(head, three):
    write("six.csv", head + "\n" + "".join("%s,%s,%s\n" % (m, ",".join(r[c] for c in xyz), ",".join("%.14f" % v for v in three(r))) for m, r in zip(names, poses)))
write("quat.csv", "name,x [mm],y [mm],z [mm],qw,qx,qy,qz\n" + "".join("%s,%s\n" % (m, ",".join(r[c] for c in xyz + quat)) for m, r in zip(names, poses)))
imports("quat.csv", "log6.csv", says=("full poses",), gives=poses, columns=q + xyz + quat, tolerance=1e-8)
six("name,x_mm,y_mm,z_mm,rx_rad,ry_rad,rz_rad", lambda r: fixed(turned(r)))
imports("six.csv", "log6.csv", "--angles", "fixed-xyz", gives=poses, columns=q + xyz + quat, tolerance=1e-7)
refuses("six.csv", "log6.csv", says=("six.csv:1", "--angles fixed-xyz"))
six("name,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg", lambda r: map(math.degrees, moving(turned(r))))
imports("six.csv", "log6.csv", "--angles", "moving-xyz", gives=poses, columns=xyz + quat, tolerance=1e-7)
six("name,x_mm,y_mm,z_mm,rx,ry,rz", vector)
refuses("six.csv", "log6.csv", "--angles", "rotation-vector", says=("--angle-unit", "angle"))
imports("six.csv", "log6.csv", "--angles", "rotation-vector", "--angle-unit", "rad", gives=poses, columns=xyz + quat, tolerance=1e-7)
six("name,x_mm,y_mm,z_mm,a_deg,b_deg,c_deg", lambda r: [math.degrees(v) for v in reversed(fixed(turned(r)))])
imports("six.csv", "log6.csv", gives=poses, columns=xyz + quat, tolerance=1e-7)
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
imports("refl_order.txt", "logr.csv", "--join", "order", "--reflectors", "4", "--unit", "mm", gives=ref, columns=q + points)
refuses("refl_order.txt", "logr.csv", "--join", "order", "--reflectors", "3", "--unit", "mm", says=("120 points", "160"))
refuses("refl_order.txt", "logr.csv", "--unit", "mm", says=("--join", "order or time"))
# One reflector of a pose was not seen: that pose is listed, the others are data.
write("hole.txt", "// Units: mm\n" + "".join("Cell::%s_%s %s %s %s\n" % (m, l, *v) for m, l, v in four if (m, l) != ("P07", "C")) + "Cell::base1 1 2 3\n")
told = imports("hole.txt", "logr.csv", "--names", "*::{pose}_{reflector}", says=("P07", "without reflector c", "base1", "a name of another kind"))
if told["rows"] != 39 or len(told["points_without_joints"]) != 4 or told["joints_without_point"] != ["P07 (line 8)"]: fail(told)

# --- who has no partner is listed
few = [l for l in open("log.csv") if not l.startswith(("P03", "P11"))]
write("few.csv", "".join(few) + "Q1," + ",".join(data[0][c] for c in q) + "\n")
told = imports("sa.txt", "few.csv", says=("2: points of sa.txt without joint readings", "P03", "P11", "Q1 (line 40)"))
if told["rows"] != 38 or len(told["points_without_joints"]) != 2 or len(told["joints_without_point"]) != 1: fail(told)
refuses_log("nobody.csv", open("log.csv").read().replace("\nP", "\nR"), says=("none with a partner", "R01"))

# --- names twice
refuses_points("twice.txt", open("sa.txt").read() + "A::Poses::P05 1 2 3\n", says=("twice.txt:45", "--repeats"))
told = imports("twice.txt", "log.csv", "--repeats")
if told["rows"] != 41: fail(told)
refuses_log("twice.csv", open("log.csv").read() + "P05," + ",".join(data[0][c] for c in q) + "\n", says=("twice.csv:42", "line 6"))

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
ten_hertz = [(k, iso(m + d / 10) + "Z") for k, m in enumerate(moments) for d in range(-4, 5)]
write("robot.log", log_text(ten_hertz))
write("timed.csv", "Timestamp,X [mm],Y [mm],Z [mm]\n" + "".join("%sZ,%s\n" % (iso(m - 5 + 0.03), ",".join(r[c] for c in xyz)) for m, r in zip(moments, data)))
told = imports("timed.csv", "robot.log", "--map", "map.yaml", "--join", "time", "--time-shift", "5", "--tolerance", "0.2",
               says=("by time",), gives=[dict(r, payload_kg="1.108" if k % 2 else "0") for k, r in enumerate(data)], columns=q + xyz + ["payload_kg"], tolerance=1e-8)
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
refuses_log("nounit.csv", open("log.csv").read().replace("_deg", ""), says=("nounit.csv:1", "q1", "--joint-unit"))
imports("sa.txt", "nounit.csv", "--joint-unit", "deg")
refuses("sa.txt", "log.csv", "--joint-unit", "rad", says=("--joint-unit", "deg"))
refuses_log("named.csv", open("log.csv").read().replace("q1_deg", "base axis"), says=("named.csv:1", "--map"))
imports("sa.txt", "named.csv", "--joint-columns", "base axis,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg", "--joint-unit", "deg")
refuses("sa.txt", "named.csv", "--joint-columns", "bas axis,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg", says=("'base axis'",))
bad = open("log.csv").read().split("\n"); bad[4] = "P04,0,500,0,0,0,0"
refuses_log("beyond.csv", "\n".join(bad), says=("beyond.csv:5", "q2_deg", "limits of joint 2"))
refuses_log("radians.csv", "point," + ",".join(q) + "\n" + "".join("%s,%s\n" % (m, ",".join("%.9f" % math.radians(float(r[c])) for c in q)) for m, r in zip(names, data)),
            says=("radians.csv", "look like radians"))
for bad, says in (("joints: [1, 2]", "six joints"), ("time: {column: t, unit: h}", "s, ms or us"), ("delimiter: '|'", "delimiter"),
                  ("context: {payload_k: t}", "payload_kg"), ("jonits: []", "did you mean 'joints'"), ("joints: 3", "a list")):
    write("bad.yaml", bad + "\n")
    refuses("sa.txt", "log.csv", "--map", "bad.yaml", says=("bad.yaml:1", says))
refuses("sa.txt", "log.csv", "--map", "map.yaml", says=("log.csv",))
refuses("sa.txt", "log.csv", "--map", "map.yaml", "--joint-columns", "a,b,c,d,e,f", code=2, says=("--map",))

# --- the points: what cannot be known or is wrong
body = "".join("%s %s %s %s\n" % (m, *(r[c] for c in xyz)) for m, r in zip(names, data))
refuses_points("bare2.txt", body, says=("bare2.txt:1", "--unit", "none"))
refuses("sa.txt", "log.csv", "--unit", "m", says=("--unit", "mm"))
refuses_points("two_units.txt", "// Units: mm\n// Units: inches\n" + body, says=("two_units.txt:2", "same units"))
refuses_points("mixed_units.csv", "name,x [mm],y [m],z [mm]\nP01,1,2,3\n", says=("mixed_units.csv:1", "y [m]"))
lines = body.split("\n")
lines[9] = lines[9].replace(" ", " ,", 1) + " 5"
refuses_points("long.txt", "\n".join(lines), "--unit", "mm", says=("long.txt:10",))
refuses_points("text.csv", "name,x_mm,y_mm,z_mm\nP01,1,2,3\nP02,1,---,3\n", says=("text.csv:3", "y_mm", "'---'"))
refuses_points("cell.csv", "name,x_mm,y_mm,z_mm\nP01,1,2,3\nP02,1,,3\n", says=("cell.csv:3", "y_mm", "an empty field"))
refuses_points("marks.csv", "name;x_mm;y_mm;z_mm\nP01;1,5;2,5;3,5\nP02;1,5;2.5;3,5\n", says=("marks.csv:3", "y_mm", "'2.5'"))
refuses_points("thousands.csv", "name;x_mm;y_mm;z_mm\nP01;1.500,5;2,5;3,5\n", says=("thousands.csv:2", "'1.500,5'"))
refuses_points("which.csv", "P01,1,5,2,5,3,5\n", "--unit", "mm", says=("which.csv:1", "--columns"))
refuses_points("short.csv", "name,x_mm,y_mm,z_mm\nP01,1,5,2,5,3,5\n", says=("short.csv:2", "4 fields", "7"))
refuses_points("two_x.csv", "name,x_mm,y_mm,z_mm,measured x_mm\nP01,1,2,3,4\n", says=("two_x.csv:1", "--columns"))
refuses_points("nothing.txt", "// only words\n", says=("nothing.txt",))
write("utf16.txt", "name x y z\nP01 1 2 3\n", "utf-16")
refuses("utf16.txt", "log.csv", says=("utf16.txt", "UTF-8"))
refuses("absent.txt", "log.csv", says=("absent.txt", "can be read"))
refuses("sa.txt", "absent.csv", says=("absent.csv", "can be read"))
refuses("sa.txt", "log.csv", "--columns", "nam,x,y,z", says=("did you mean 'name'",))
refuses("refl.txt", "logr.csv", "--names", "{reflector}", says=("{pose}",))
code, said, warned = run("import", "sa.txt", "--joints", "log.csv", "-o", "no.csv")
if code != 2 or "--robot" not in warned: fail("without --robot:", code, warned)

# --- numbers of options are finite
for option in ("--tolerance", "--time-shift", "--coverage"):
    for value in ("nan", "inf", "-inf", "1e999"):
        refuses("timed.csv", "robot.log", "--map", "map.yaml", "--join", "time", "%s=%s" % (option, value), code=2, says=(option,))

# --- units that contradict each other: of two sources none wins
def log_as(path, *columns, before=""):
    write(path, before + "point," + ",".join(columns) + "\n" + "".join("%s,%s\n" % (m, ",".join(r[c] for c in q)) for m, r in zip(names, data)))
plain = ["q%d" % j for j in range(1, 7)]
def points_as(path, header, before=""):
    write(path, before + header + "\n" + "".join("%s,%s\n" % (m, ",".join(r[c] for c in xyz)) for m, r in zip(names, data)))
def spread_as(path, before, more=""):
    write(path, before + "".join("%s,%s%s\n" % (m, ",".join(r[c] for c in xyz), more) for m, r in zip(names, data)))
points_as("pu.csv", "name,X [mm],Y [mm],Z [mm]", "Units: Inches\n")
refuses("pu.csv", "log.csv", says=("pu.csv:2", "X [mm]", "in, as line 1", "mm"))
points_as("pu.csv", "name,X [mm],Y [mm],Z [mm]", "Units: Millimeters\n")
imports("pu.csv", "log.csv", "--unit", "mm", gives=data)
for line in ("# Units: sigma um, coordinates mm\n", "# Units: mm, uncertainty in um\n", "# Units: in, mm\n", "// Units: mm / m\n", "# Units: Millimeters, deg, rad\n"):
    spread_as("pu.csv", line)
    refuses("pu.csv", "log.csv", says=("pu.csv:1", "one unit", line.strip("#/ \n")))
spread_as("pu.csv", "# Units: furlongs\n")
refuses("pu.csv", "log.csv", "--unit", "mm", says=("pu.csv:1", "furlongs"))
spread_as("pu.csv", "# Units: Metric\n")
imports("pu.csv", "log.csv", "--unit", "mm")
refuses("pu.csv", "log.csv", says=("pu.csv:2", "--unit"))
spread_as("pu.csv", "# Tracker unit 3, 5 m from the robot\n")
refuses("pu.csv", "log.csv", says=("pu.csv:2", "--unit"))
imports("pu.csv", "log.csv", "--unit", "mm", gives=data)
for line, scale in (("# Units: mm", 1), ("# Unit = mm", 1), ("# Units are in millimetres", 1), ("# units in mm", 1), ("# Units mm, deg", 1), ("# Unit of length: mm", 1),
                    ("# Units: Millimeters, Degrees, Fahrenheit", 1), ("# Units: angles in deg, lengths in mm", 1), ("# Units: in, deg", 25.4), ("# Units are in in", 25.4),
                    ("# Einheit: mm", 1), ("# Tracker unit 3, units: mm", 1)):
    spread_as("pu.csv", line + "\n")
    imports("pu.csv", "log.csv", gives=[dict(r, **{c: str(scale * float(r[c])) for c in xyz}) for r in data], columns=xyz, tolerance=1e-7)
log_as("lu.csv", *["J%d [deg]" % j for j in range(1, 7)], before="# Units: rad\n")
refuses("sa.txt", "lu.csv", says=("lu.csv:2", "J1 [deg]", "rad, as line 1"))
log_as("lu.csv", *plain, before="# Units: deg\n# Units: rad\n")
refuses("sa.txt", "lu.csv", says=("lu.csv:2", "same units"))
log_as("lu.csv", *plain, before="# Units: deg\n")
imports("sa.txt", "lu.csv")
refuses("sa.txt", "lu.csv", "--joint-unit", "rad", says=("lu.csv", "--joint-unit", "line 1", "deg"))
def map_of(path, units):
    write(path, "joints:\n" + "".join("  - {column: q%d%s}\n" % (j + 1, ", unit: " + units[j] if j < len(units) else "") for j in range(6)) )
map_of("mu.yaml", ["rad"])
refuses("sa.txt", "lu.csv", "--map", "mu.yaml", says=("lu.csv:2", "q1", "mu.yaml", "rad", "deg"))
log_as("lu.csv", *plain)
map_of("mu.yaml", ["deg"] * 6)
imports("sa.txt", "lu.csv", "--map", "mu.yaml")
imports("sa.txt", "lu.csv", "--map", "mu.yaml", "--joint-unit", "deg")
refuses("sa.txt", "lu.csv", "--map", "mu.yaml", "--joint-unit", "rad", says=("lu.csv:1", "q1", "mu.yaml", "--joint-unit"))
map_of("mu.yaml", ["deg"])
imports("sa.txt", "lu.csv", "--map", "mu.yaml", "--joint-unit", "deg")

# --- units that are not understood
for unit in ("mrad", "grad", "V", "deg/s", "1e-3 deg"):
    log_as("lu.csv", *["J%d [%s]" % (j, unit) for j in range(1, 7)])
    refuses("sa.txt", "lu.csv", "--joint-unit", "deg", says=("lu.csv:1", "J1 [%s]" % unit, "deg or rad"))
    refuses("sa.txt", "lu.csv", "--joint-columns", ",".join("J%d [%s]" % (j, unit) for j in range(1, 7)), "--joint-unit", "deg", says=("lu.csv:1", "J1 [%s]" % unit, "deg or rad"))
def with_column(path, name, cells, joints=q, before=""):
    write(path, before + "point,%s,%s\n" % (",".join(joints), name) + "".join("%s,%s,%s\n" % (m, ",".join(r[c] for c in q), cells(k)) for k, (m, r) in enumerate(zip(names, data))))
for key, column, cell in (("payload_kg", "Last [g]", "3000"), ("temp_c", "Temp [F]", "68"), ("payload_kg", "Last_g", "3000"), ("move1_deg", "Weg [rad]", "0.1"), ("payload_x_mm", "Px (m)", "0.1"),
                          ("fx_n", "Fx [kN]", "0.1")):
    with_column("cu.csv", column, lambda k: cell)
    write("mu.yaml", "context: {%s: '%s'}\n" % (key, column))
    refuses("sa.txt", "cu.csv", "--map", "mu.yaml", says=("cu.csv:1", column, key))
for key, column, cell in (("payload_kg", "Last [kg]", "3"), ("temp_c", "Temp [°C]", "20"), ("temp_c", "Temp", "20"), ("move1_deg", "Weg (degrees)", "1"), ("dir1", "Richtung", "1"), ("fx_n", "Fx [N]", "5")):
    with_column("cu.csv", column, lambda k: cell)
    write("mu.yaml", "context: {%s: '%s'}\n" % (key, column))
    imports("sa.txt", "cu.csv", "--map", "mu.yaml")
    if float(rows("out.csv")[0][key]) != float(cell): fail(key, rows("out.csv")[0])
for column, how in (("Zeit [ms]", "{column: 'Zeit [ms]', unit: s}"), ("Zeit [min]", "'Zeit [min]'"), ("Zeit [min]", "{column: 'Zeit [min]', unit: s}")):
    with_column("cu.csv", column, lambda k: 1000 * k)
    write("mu.yaml", "time: %s\n" % how)
    refuses("sa.txt", "cu.csv", "--map", "mu.yaml", says=("cu.csv:1", column, "s"))
with_column("cu.csv", "Time [min]", lambda k: k)
refuses("sa.txt", "cu.csv", says=("cu.csv:1", "Time [min]", "ms"))
with_column("cu.csv", "Time [ms]", lambda k: 1000 * k)
imports("sa.txt", "cu.csv")
if float(rows("out.csv")[1]["time_s"]) != shuffled[1]: fail("ms", rows("out.csv")[1])
with_column("cu.csv", "Time", lambda k: 1000 * k, before="# Units: deg, ms\n")
imports("sa.txt", "cu.csv")
if float(rows("out.csv")[1]["time_s"]) != shuffled[1]: fail("ms in a line above", rows("out.csv")[1])
with_column("cu.csv", "Time [s]", lambda k: 1000 * k, before="# Units: deg, ms\n")
refuses("sa.txt", "cu.csv", says=("cu.csv:2", "Time [s]", "line 1"))
with_column("cu.csv", "Time [UTC]", lambda k: "12:00:%02d" % k)
imports("sa.txt", "cu.csv")
write("pt.csv", "Time [min],x_mm,y_mm,z_mm\n" + "".join("%d,%s\n" % (k, ",".join(r[c] for c in xyz)) for k, r in enumerate(data)))
with_column("cu.csv", "Time", lambda k: k)
refuses("pt.csv", "cu.csv", "--join", "time", says=("pt.csv:1", "Time [min]", "ms"))

# --- columns of which two could be meant
def log_of(path, header, cells, rows=data):
    write(path, ",".join(header) + "\n" + "".join(",".join(cells(m, [r[c] for c in q])) + "\n" for m, r in zip(names, rows)))
volts = ["A%d [V]" % j for j in range(1, 7)]
log_of("two.csv", ["point"] + volts + ["J%d" % j for j in range(1, 7)], lambda m, v: [m] + ["1.5"] * 6 + v)
imports("sa.txt", "two.csv", "--joint-unit", "deg", says=("joints J1 J2 J3 J4 J5 J6", "not read: A1 [V]"), gives=[data[k] for k in shuffled])
log_of("two.csv", ["point"] + ["J%d [deg]" % j for j in range(1, 7)] + ["J%d [deg/s]" % j for j in range(1, 7)], lambda m, v: [m] + v + ["7"] * 6)
imports("sa.txt", "two.csv", gives=[data[k] for k in shuffled])
log_of("two.csv", ["point"] + q + ["j%d_deg" % j for j in range(1, 7)], lambda m, v: [m] + v + ["1.5"] * 6)
refuses("sa.txt", "two.csv", says=("two.csv:1", "q1_deg", "j1_deg", "--map", "--joint-columns"))
imports("sa.txt", "two.csv", "--joint-columns", ",".join(q), gives=[data[k] for k in shuffled])
log_of("two.csv", ["point"] + q + ["q1_deg"], lambda m, v: [m] + v + ["1.5"])
refuses("sa.txt", "two.csv", says=("two.csv:1", "q1_deg", "once"))
refuses("sa.txt", "two.csv", "--joint-columns", ",".join(q), says=("two.csv:1", "q1_deg", "once"))
log_of("two.csv", ["nr", "pose"] + q, lambda m, v: [str(int(m[1:]) % 40 + 1), m] + v)
refuses("sa.txt", "two.csv", says=("two.csv:1", "nr", "pose", "--map"))
imports("sa.csv", "two.csv", "--join", "order")
write("mu.yaml", "name: pose\n")
imports("sa.txt", "two.csv", "--map", "mu.yaml", gives=[data[k] for k in shuffled])
log_of("two.csv", ["pose", "time", "timestamp"] + q, lambda m, v: [m, "1", "2"] + v)
refuses("sa.txt", "two.csv", says=("two.csv:1", "time", "timestamp", "--map"))
log_of("two.csv", ["pose", "payload_kg", "payload_kg"] + q, lambda m, v: [m, "1", "2"] + v)
refuses("sa.txt", "two.csv", says=("two.csv:1", "payload_kg", "once"))
log_of("two.csv", ["pose", "comment", "comment"] + q, lambda m, v: [m, "1", "2"] + v)
imports("sa.txt", "two.csv", says=("not read: comment, comment",))

# --- a fourth number without header is no name
spread_as("four.csv", "", ",0.015")
refuses("four.csv", "log.csv", "--unit", "mm", "--join", "order", says=("four.csv:1", "--columns"))
imports("four.csv", "log.csv", "--unit", "mm", "--join", "order", "--columns", "name,x,y,z,sigma", gives=[dict(r, sigma_mm="0.015") for r in data], columns=q + xyz + ["sigma_mm"])
for first in ("100.5", "1e3", "1E-3"):
    refuses_points("four.csv", "".join("%s,%s\n" % (first, ",".join(r[c] for c in xyz)) for r in data), "--unit", "mm", "--join", "order", says=("four.csv:1", first, "--columns"))
refuses_points("four.csv", "".join("%s;%s\n" % (m, ";".join([comma(r[c]) for c in xyz] + ["0,015"])) for m, r in zip(names, data)), "--unit", "mm", "--join", "order", says=("four.csv:1", "--columns"))
refuses_points("four.csv", "".join("Day1,%d,%s\n" % (k, ",".join(r[c] for c in xyz)) for k, r in enumerate(data)), "--unit", "mm", "--join", "order", says=("four.csv:1", "--columns"))
imports("four.csv", "log.csv", "--unit", "mm", "--join", "order", "--columns", "group,name,x,y,z")
write("four.csv", "".join("%d,%s\n" % (k, ",".join(r[c] for c in xyz)) for k, r in enumerate(data)))
imports("four.csv", "log.csv", "--unit", "mm", "--join", "order", gives=data)

# --- options that do not apply
timed = ("timed.csv", "robot.log", "--map", "map.yaml", "--time-shift", "5", "--tolerance", "0.2", "--join", "time")
for more in (("--reflectors", "3"), ("--names", "{pose}_{reflector}"), ("--repeats",)):
    refuses(*timed, *more, code=2, says=(more[0], "--join"))
for join, more in (("order", ("--names", "{pose}")), ("order", ("--repeats",)), ("order", ("--tolerance", "1")), ("order", ("--time-shift", "1")),
                   ("name", ("--reflectors", "3")), ("name", ("--tolerance", "1")), ("name", ("--time-shift", "0"))):
    refuses("sa.txt", "log.csv", "--join", join, *more, code=2, says=(more[0], "--join"))
refuses("sa.txt", "log.csv", "--reflectors", "4", code=2, says=("--reflectors", "--join order"))
refuses("sa.txt", "log.csv", "--angles", "fixed-xyz", says=("sa.txt", "--angles", "rx"))
refuses("sa.txt", "log.csv", "--angle-unit", "deg", says=("sa.txt", "--angle-unit"))
refuses("sa.txt", "log.csv", "--coverage", "2", says=("sa.txt", "--coverage", "sigma"))
for more in (("--unit", "mm"), ("--join", "time"), ("--robot", robot), ("--repeats",), ("--map", "map.yaml"), ("--tolerance", "1")):
    code, said, warned = run("import", root + "/tests/data/tx60l.urdf", "-o", "no.yaml", *more)
    if code != 2 or more[0] not in warned or "--joints" not in warned: fail("a URDF with", more, "gives", code, warned)
    if os.path.exists("no.yaml"): fail("a refused import leaves a file")

# --- thousands or decimals
for gap, quote in ((",", '"'), (";", ""), (";", '"'), ("\t", "")):
    cell = lambda v: quote + v + quote
    refuses_points("k.txt", "\n".join(gap.join([m] + [cell(v) for v in r]) for m, r in (("P01", ("1,234", "5,678", "9,012")), ("P02", ("2,234", "5,678", "850")))) + "\n", "--unit", "mm",
                   says=("k.txt:1", "'1,234'", "--decimal"))
    imports("k.txt", "log.csv", "--unit", "mm", "--decimal", "comma")
    if float(rows("out.csv")[0]["x_mm"]) != 1.234: fail(rows("out.csv")[0])
    refuses("k.txt", "log.csv", "--unit", "mm", "--decimal", "point", says=("k.txt", "1,234"))
    # What cannot part thousands is a decimal comma: another number of digits behind it, a zero or four digits before it.
    for sure in ("1,2", "1,2345", "0,123", "-0,123", "1234,567", "-12,3456"):
        write("k.txt", "\n".join(gap.join([m] + [cell(v) for v in r]) for m, r in (("P01", ("1,234", "5,678", "9,012")), ("P02", ("2,234", sure, "850")))) + "\n")
        imports("k.txt", "log.csv", "--unit", "mm")
        if float(rows("out.csv")[1]["y_mm"]) != float(sure.replace(",", ".")): fail(sure, rows("out.csv")[1])
# A joint never turns a thousand degrees, but a payload may weigh 1,250 kg.
write("kl.csv", "point;" + ";".join(q) + ";payload_kg\nP01;12,345;-45,000;90;0;1;2;1,250\nP02;1;2;3;4;5;6;2\n")
write("k.txt", "P01 1.5 2.5 3.5\nP02 1.5 2.5 3.5\n")
imports("k.txt", "kl.csv", "--unit", "mm")
if [float(rows("out.csv")[0][c]) for c in ("q1_deg", "payload_kg")] != [12.345, 1.25]: fail(rows("out.csv")[0])
write("kl.csv", open("kl.csv").read().replace("12,345", "12").replace("-45,000", "-45"))
refuses("k.txt", "kl.csv", "--unit", "mm", says=("kl.csv:2", "payload_kg", "'1,250'", "decimal", "--map"))
write("mu.yaml", "decimal: ','\n")
imports("k.txt", "kl.csv", "--unit", "mm", "--map", "mu.yaml")

# --- zones and midnight
def clocks(path_points, path_log, of_point, of_row):
    write(path_points, "time,x_mm,y_mm,z_mm\n" + "".join("%s,%s\n" % (of_point(k), ",".join(r[c] for c in xyz)) for k, r in enumerate(data)))
    write(path_log, "time," + ",".join(q) + "\n" + "".join("%s,%s\n" % (of_row(k), ",".join(r[c] for c in q)) for k, r in enumerate(data)))
zoned = lambda zone, hour=12: lambda k: "2026-03-01T%02d:00:%02d%s" % (hour, k, zone)
clocks("zp.csv", "zl.csv", zoned("+01:00", 13), zoned(""))
refuses("zp.csv", "zl.csv", "--join", "time", says=("zp.csv:2", "zone", "without"))
clocks("zp.csv", "zl.csv", zoned(""), zoned("Z"))
refuses("zp.csv", "zl.csv", "--join", "time", says=("zp.csv:2", "zone"))
clocks("zp.csv", "zl.csv", zoned("+01:00", 13), lambda k: zoned("Z" if k != 3 else "")(k))
refuses("zp.csv", "zl.csv", "--join", "time", says=("zl.csv:5", "zone"))
log_of("zn.csv", ["pose", "time"] + q, lambda m, v: [m, zoned("Z" if m != "P04" else "")(int(m[1:]))] + v)
refuses("sa.txt", "zn.csv", says=("zn.csv:5", "zone"))
clocks("zp.csv", "zl.csv", zoned("+25:00", 13), zoned("Z"))
refuses("zp.csv", "zl.csv", "--join", "time", says=("zp.csv:2", "+25:00"))
for of_point, of_row in ((zoned(""), zoned("")), (zoned("+01:00", 13), zoned("Z")), (zoned("-0130", 10), zoned("+00", 11))):
    clocks("zp.csv", "zl.csv", of_point, of_row)
    if "-0130" in of_point(0): write("zp.csv", open("zp.csv").read().replace("T10:00", "T09:30"))
    imports("zp.csv", "zl.csv", "--join", "time", "--tolerance", "0.2", gives=data)
around = lambda k: "%02d:%02d:00" % divmod((23 * 60 + 50 + k) % 1440, 60)
log_of("zn.csv", ["pose", "time"] + q, lambda m, v: [m, around(int(m[1:]))] + v)
refuses("sa.txt", "zn.csv", says=("zn.csv:11", "time", "00:00:00", "date"))
clocks("zp.csv", "zl.csv", around, lambda k: "12:00:%02d" % k)
refuses("zp.csv", "zl.csv", "--join", "time", says=("zp.csv:12", "00:00:00", "date"))
clocks("zp.csv", "zl.csv", lambda k: "12:00:%02d" % k, lambda k: "12:00:%02d" % (39 - k))
imports("zp.csv", "zl.csv", "--join", "time", "--tolerance", "0.2", gives=[{**data[39 - k], **{c: data[k][c] for c in xyz}} for k in range(n)])

# --- two columns of the same uncertainty, and how figures are written
write("su.csv", "name,x_mm,y_mm,z_mm,sigma [um],ux [um],uy [um],uz [um]\n" + "".join("%s,%s,99,15,15,15\n" % (m, ",".join(r[c] for c in xyz)) for m, r in zip(names, data)))
imports("su.csv", "log.csv", says=("not read: sigma [um]",))
if {r["sigma_mm"] for r in rows("out.csv")} != {"0.015"}: fail("sigma", rows("out.csv")[0])
refuses("su.csv", "log.csv", "--columns", "name,x,y,z,sigma,sx,sy,sz", says=("su.csv:1", "--columns"))
write("rs.txt", "// Units: mm\n// Name X Y Z sigma\n" + "".join("%s_%s %s %s %s 0.015\n" % (m, l, *v) for m, l, v in four))
imports("rs.txt", "logr.csv", "--names", "{pose}_{reflector}")
if {r["sigma_mm"] for r in rows("out.csv")} != {"0.015"}: fail("sigma of reflectors", rows("out.csv")[0])
for tiny in ("1e-300", "1e-12", "0", "-1"):
    refuses_points("su.csv", "name,x_mm,y_mm,z_mm,sigma\nP01,1,2,3,0.1\nP02,4,5,6,%s\n" % tiny, says=("su.csv:3", "sigma"))

# --- text: Latin-1 as UTF-8, line ends
for encoding in ("latin-1", "utf-8"):
    write("la.csv", "Name,X [mm],Y [mm],Z [mm],Ux [µm],Uy [µm],Uz [µm]\n" + "".join("Prüf%s,%s,15,15,15\n" % (m, ",".join(r[c] for c in xyz)) for m, r in zip(names, data)), encoding)
    write("ll.csv", "point," + ",".join(q) + "\n" + "".join("Prüf%s,%s\n" % (m, ",".join(r[c] for c in q)) for m, r in zip(names, data)), "utf-8" if encoding == "latin-1" else "latin-1")
    told = imports("la.csv", "ll.csv", gives=[dict(r, sigma_mm="0.015") for r in data], columns=q + xyz + ["sigma_mm"])
    if rows("out.csv")[0]["point"] != "PrüfP01": fail(rows("out.csv")[0])
write("cr.txt", open("sa.txt").read().replace("\n", "\r"))
write("crl.csv", open("log.csv").read().replace("\n", "\r"))
imports("cr.txt", "crl.csv", gives=[data[k] for k in shuffled])
refuses_points("cr.txt", open("sa.txt").read().replace("\n", "\r", 6), says=("cr.txt:1", "CR alone"))
code, said, warned = run("import", "cr.txt", "--joints", "log.csv", "--robot", robot, "-o", "no.csv")
if "\r" in warned: fail("raw CR", repr(warned))

# --- a list of what has no partner has an end; the count tells points
long_log = "point," + ",".join(q) + "\n" + "".join("%s,%s\n" % ("P%02d" % (k + 1) if k < n else "R%d" % k, ",".join(data[k % n][c] for c in q)) for k in range(2040))
write("long.csv", long_log)
code, said, warned = run("import", "sa.csv", "--joints", "long.csv", "--robot", robot, "-o", "out.csv", "--json", "out.json")
told = json.load(open("out.json"))
if code or len(told["joints_without_point"]) != 2000 or len(said.split("\n")) > 30 or "1980 more" not in said: fail("a long list", code, said[:300], warned)

# --- names: reflectors that some poses have and most have not; patterns
three = "".join("%s_%s %s %s %s\n" % (m, l, *v) for m, l, v in four if l != "D")
write("stray.txt", "// Units: mm\n" + three + "P02_d 1 2 3\n")
refuses("stray.txt", "logr.csv", "--names", "{pose}_{reflector}", says=("stray.txt:122", "P02_d", "39 poses", "this pose alone"))
write("stray.txt", "// Units: mm\n" + three)
imports("stray.txt", "logr.csv", "--names", "{pose}_{reflector}")
for pattern in ("*{pose}_{reflector}", "{pose}*", "{pose}*_{reflector}"):
    refuses("refl.txt", "logr.csv", "--names", pattern, says=("--names", "between * and {pose}"))
huge = "A" * 150000 + "::" + "B" * 150000
write("huge.txt", "// Units: mm\n" + three + huge + "_a 1 2 3\n")
for pattern, status in (("{pose}_{reflector}", 0), ("*_{reflector}::{pose}", 3), ("*A*A*::{pose}B_{reflector}", 3), ("*::{pose}_{reflector}", 3)):
    code, said, warned = run("import", "huge.txt", "--joints", "logr.csv", "--robot", robot, "--names", pattern, "-o", "out.csv")
    if code != status: fail("a name of 300 kB with", pattern, "ends with", code, warned[:200])
# A pattern takes a name apart as the same regular expression does.
dice = random.Random(11)
matched = 0
for _ in range(40):
    text = lambda: "".join(dice.choice("ab_:") for _ in range(dice.randint(1, 2)))
    pattern = dice.choice(["", text(), "*" + text(), "**" + text()]) + "{pose}" + dice.choice(["", text(), text() + "*", text() + "*" + text()])
    name = "P" + "".join(dice.choice("ab_:") for _ in range(dice.randint(3, 14)))
    wanted = re.fullmatch(re.escape(pattern).replace(r"\*", ".*").replace(r"\{pose\}", "(.+)"), name)
    poses_of_log = [wanted.group(1)] if wanted else sorted({name[i:j] for i in range(len(name)) for j in range(i + 1, len(name) + 1)})
    write("np.csv", "name,x_mm,y_mm,z_mm\n%s,1,2,3\n" % name)
    write("nl.csv", "pose," + ",".join(q) + "\n" + "".join("%s,%s\n" % (p, ",".join(data[k % n][c] for c in q)) for k, p in enumerate(poses_of_log)))
    code, said, warned = run("import", "np.csv", "--joints", "nl.csv", "--robot", robot, "--names", pattern, "-o", "out.csv")
    if code != (0 if wanted else 3): fail(name, "with", pattern, "is", wanted, "and gives", code, warned)
    matched += wanted is not None
if not 5 < matched < 35: fail("names that match:", matched)

# --- no data file over what it is made of
for more in (("-o", "sa.txt"), ("-o", "log.csv"), ("-o", "./log.csv"), ("-o", "mu.yaml", "--map", "mu.yaml"), ("-o", "out.csv", "--json", "out.csv"), ("-o", "out.csv", "--json", "sa.txt")):
    before = {f: open(f).read() for f in ("sa.txt", "log.csv", "mu.yaml")}
    code, said, warned = run("import", "sa.txt", "--joints", "log.csv", "--robot", robot, *more)
    if code != 2 or more[-2] not in warned and more[0] not in warned: fail("import", more, "gives", code, warned)
    if before != {f: open(f).read() for f in before}: fail("import", more, "wrote over what it read")

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
finish()
