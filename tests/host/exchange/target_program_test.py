#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""flexcomp compensate on programs of robot makers: what stands in a KUKA, ABB or Stäubli program comes out as what the plain
CSV of the same targets gives, on the branch that the target names, and every other byte stays."""
import json, math, os, random, re
from command import done, fail, finish, matrix, q, quat, read, root, rows, run, write, xyz
dice = random.Random(2)
geometry = "geometric:\n" + "".join("  - {link: %d, theta_deg: %g, d_mm: %g, a_mm: %g, alpha_deg: %g}\n" % (
    i, *(dice.uniform(-s, s) for s in (0.1, 0.5, 0.5, 0.1))) for i in range(1, 7)).replace("link: 2, theta_deg", "link: 2, theta_deg")
write("cal.yaml", geometry + "effects:\n  - {effect: joint_compliance, joint: 2, rad_per_nm: 2.0e-5}\n")

def abc(m):  # KUKA: Rz(A) Ry(B) Rx(C)
    return [math.degrees(v) for v in (math.atan2(m[1][0], m[0][0]), math.atan2(-m[2][0], math.hypot(m[0][0], m[1][0])), math.atan2(m[2][1], m[2][2]))]
def from_abc(a, b, c):
    a, b, c = (math.radians(v) for v in (a, b, c))
    ca, sa, cb, sb, cc, sc = math.cos(a), math.sin(a), math.cos(b), math.sin(b), math.cos(c), math.sin(c)
    return [[ca*cb, ca*sb*sc-sa*cc, ca*sb*cc+sa*sc], [sa*cb, sa*sb*sc+ca*cc, sa*sb*cc-ca*sc], [-sb, cb*sc, cb*cc]]

NUMBER = r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"

# --- KUKA: F0 of this arm is upside down in ROBROOT, half a turn about x
kuka = root + "/host/robots/kuka-kr6-r900.yaml"
def turned(v): return [v[0], -v[1], -v[2]]
n = 24
joints = []
limits = [(-160, 160), (-180, 40), (-110, 150), (-170, 170), (-115, 115), (-170, 170)]
while len(joints) < n:
    p = [dice.uniform(a + 5, b - 5) for a, b in limits]
    if abs(p[4]) > 15 and abs(p[2] - 0) > 20: joints.append([round(v, 4) for v in p])
write("t.csv", ",".join(q) + "\n" + "".join(",".join("%.4f" % v for v in p) + "\n" for p in joints))
done("compensate", "--robot", kuka, "--calibration", "cal.yaml", "--targets", "t.csv", "-o", "c.csv", "--quiet")
done("predict", "--robot", kuka, "--joints", "t.csv", "-o", "p.csv", "--quiet")
done("predict", "--robot", kuka, "--joints", "c.csv", "-o", "pc.csv", "--quiet")
corrected = rows("c.csv")
nominal, reached = rows("p.csv"), rows("pc.csv")
def kuka_pose(r):
    p = turned([float(r[c]) for c in xyz])
    m = matrix(*(float(r[c]) for c in quat))
    return p, [m[0], [-v for v in m[1]], [-v for v in m[2]]]
def turn(p): return sum(1 << j for j, v in enumerate(p) if v < 0)

dat = ["&ACCESS RVP\r\n&REL 1\r\nDEFDAT  WELD PUBLIC ; {A1 1,A2 2} is a comment\r\n",
       "DECL E6AXIS XHOME={A1 %.4f,A2 %.4f,A3 %.4f,A4 %.4f,A5 %.4f,A6 %.4f,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}\r\n" % tuple(joints[0]),
       "DECL FDAT FHOME={TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE,POINT2[] \" \",TQ_STATE FALSE}\r\n",
       "DECL FRAME PART={X 1000.5,Y 20.0,Z 3.0,A 0.0,B 90.0,C 0.0}\r\nDECL LDAT LCPDAT1={VEL 2.0,ACC 100.0,APO_DIST 100.0}\r\n"]
for k in range(1, n):
    p, m = kuka_pose(nominal[k])
    dat.append("DECL E6POS XP%d={X %.9f,Y %.9f,Z %.9f,A %.9f,B %.9f,C %.9f,S 2,T %s,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}\r\n" %
               (k, *p, *abc(m), "'B%s'" % format(turn(joints[k]), "b") if k % 2 else str(turn(joints[k]))))
write("weld.dat", "".join(dat) + "ENDDAT\r\n")
# The nearest of the ways that T leaves is taken from the target before; a neighbour by hand makes it unique here.
base = ["compensate", "--robot", kuka, "--calibration", "cal.yaml"]
code, said, warned = run(*base, "--targets", "weld.dat", "--frame", "0,0,0,180,0,0", "-o", "out.dat", "--json", "k.json")
if code: fail("weld.dat", code, said, warned)
else:
    before, after = read("weld.dat"), read("out.dat")
    strip = lambda t: re.sub(r"T '?B?\d+'?", "T n", re.sub(r"(?<=[ABCXYZ1-6] )" + NUMBER, "n", t))
    if strip(before) != strip(after): fail("more than the targets' numbers changed:", after)
    for line in ("DECL FRAME PART={X 1000.5,Y 20.0,Z 3.0,A 0.0,B 90.0,C 0.0}", "{A1 1,A2 2} is a comment", "&REL 1"):
        if line not in after: fail("changed:", line)
    home = [float(v) for v in re.search(r"XHOME=\{(.*?),E1", after).group(1).replace("A1 ", "").replace("A2 ", "").replace("A3 ", "").replace("A4 ", "").replace("A5 ", "").replace("A6 ", "").split(",")]
    for a, c in zip(home, q):
        if abs(a - float(corrected[0][c])) > 1e-6: fail("XHOME", home)
    on_branch = 0
    for k in range(1, n):
        got = re.search(r"XP%d=\{X (%s),Y (%s),Z (%s),A (%s),B (%s),C (%s),S 2,T (\d+|'B[01]+')" % ((k,) + (NUMBER,) * 6), after).groups()
        p, m = kuka_pose(reached[k])
        have = from_abc(*map(float, got[3:6]))
        off = max([abs(float(a) - b) for a, b in zip(got[:3], p)])
        off_turn = max(abs(have[r][c] - m[r][c]) for r in range(3) for c in range(3))
        # Another branch with the same turns errs otherwise: those are counted below.
        if off < 2e-5 and off_turn < 2e-7: on_branch += 1
        elif off > 5: fail("XP%d" % k, got, p)
        bits = int(got[6][2:-1], 2) if "B" in got[6] else int(got[6])
        if bits != turn([float(corrected[k][c]) for c in q]) and off < 2e-5: fail("T", k, got[6])
    print(on_branch, "of", n - 1, "poses on the branch they were made on, the others on one with the same turns")
    if on_branch < (n - 1) * 2 // 3: fail("branches", on_branch)
# A single pose and a start beside it: always on its branch.
for k in range(1, 9):
    write("one.dat", dat[3 + k])
    done(*base, "--targets", "one.dat", "--frame", "0,0,0,180,0,0", "--start", ",".join("%.1f" % (v + 2) for v in joints[k]), "-o", "one_out.dat", "--quiet")
    got = re.search(r"\{X (%s),Y (%s),Z (%s)" % ((NUMBER,) * 3), read("one_out.dat")).groups()
    p, _ = kuka_pose(reached[k])
    if max(abs(float(a) - b) for a, b in zip(got, p)) > 2e-5: fail("with --start", k, got, p)
src = "DEF WELD( )\r\n;FOLD PTP P1 Vel=100 %%;%%{PE}%%R 8.3.44\r\nPTP XP1\r\nPTP {A1 %.4f,A2 %.4f,A3 %.4f,A4 %.4f,A5 %.4f,A6 %.4f}\r\nLIN {X 400,Y 0,Z 500,A 0,B 90,C 0} C_DIS\r\nEND\r\n" % tuple(joints[2])
write("weld.src", src)
done(*base, "--targets", "weld.src", "--frame", "0,0,0,180,0,0", "--start", "0,-90,90,0,0,0", "-o", "out.src", "--quiet")
if "{PE}%R 8.3.44" not in read("out.src") or "LIN {X 400,Y 0" in read("out.src"): fail("out.src", read("out.src"))
def refuses(name, text, *more, says=(), code=3, robot=kuka):
    write(name, text)
    got, said, warned = run("compensate", "--robot", robot, "--calibration", "cal.yaml", "--targets", name, "-o", "no.out", *more)
    if got != code or any(s not in warned for s in says): fail(name, repr(text[-80:]), got, warned)
    if os.path.exists("no.out"): fail("a refused program leaves a file")
refuses("r.src", "LIN {X 400,Y 0,Z 500,A 0,B 90,C 0}\n", "--frame", "0,0,0,180,0,0", says=("r.src:1", "--start", "ways"))
refuses("r.src", "; nothing\nPTP {A3 45}\n", says=("r.src:2", "all of A1"))
refuses("r.src", "PTP_REL {A3 45}\n", says=("r.src:1", "relative"))
refuses("r.src", "LIN {X 4000,Y 0,Z 500,A 0,B 90,C 0}\n", says=("r.src:1", "does not reach"))
refuses("r.src", "PTP XHOME\n", says=("r.src", "targets"))
refuses("r.src", "PTP {A1 1,A2 x,A3 2,A4 2,A5 2,A6 2}\n", says=("r.src:1", "a2", "'x'"))
refuses("r.dat", dat[4].replace("T '", "T 'X"), "--frame", "0,0,0,180,0,0", says=("r.dat:1", "T"))
flipped = re.sub(r"T '?B?\d+'?", "T 63", dat[5])
refuses("r.dat", flipped, "--frame", "0,0,0,180,0,0", says=("r.dat:1", "XP2"))
refuses("t.csv", read("t.csv"), "--start", "0,0,0,0,0,0", says=("--start",), code=2)

# With nothing to correct words stay as they are written, also where a joint stands on an edge; bits of external axes always.
write("none.yaml", "{}\n")
write("e.csv", ",".join(q) + "\n10,-80,90,0,30,0\n10,-80,90,-0.01,30,0.01\n")
done("predict", "--robot", kuka, "--joints", "e.csv", "-o", "pe.csv", "--quiet")
edges = []
for r in rows("pe.csv"):
    p, m = kuka_pose(r)
    edges.append("X %.6f,Y %.6f,Z %.6f,A %.6f,B %.6f,C %.6f" % (*p, *abc(m)))
words = ("T 2", "T 10", "T 34", "T 'B000010'", "T 'B1000010'", "T 'H02'", "T 66")
write("edge.src", "".join("LIN {%s,S 2,%s,E1 -30.0}\n" % (edges[0], w) for w in words))
near = ["--frame", "0,0,0,180,0,0", "--start", "10,-80,90,0,30,0"]
done("compensate", "--robot", kuka, "--calibration", "none.yaml", "--targets", "edge.src", "-o", "edge_out.src", *near, "--quiet")
if tuple(re.findall(r"T (?:'\w+'|\d+)", read("edge_out.src"))) != words: fail("words at an edge", read("edge_out.src"))
# Joint 4 crosses zero: its bit alone changes, in the notation that is there.
write("turn4.yaml", "geometric: [{link: 4, theta_deg: -0.05}]\n")
write("edge.src", "".join("LIN {%s,S 2,T %s,E1 -30.0}\n" % (edges[1], w) for w in ("'B1001010'", "74", "'H4A'")))
done("compensate", "--robot", kuka, "--calibration", "turn4.yaml", "--targets", "edge.src", "-o", "edge_out.src", *near, "--quiet")
if re.findall(r"T ('\w+'|\d+)", read("edge_out.src")) != ["'B1000010'", "66", "'H42'"]: fail("words across an edge", read("edge_out.src"))

# What is written is no input and no other output, whatever it is called.
write("own.src", read("weld.src"))
os.symlink("own.src", "own_link.src")
os.link("own.src", "own_hard.src")
start = ["--frame", "0,0,0,180,0,0", "--start", "0,-90,90,0,0,0"]
for outputs in (["-o", "own.src"], ["-o", "./own.src"], ["-o", "own_link.src"], ["-o", "own_hard.src"], ["-o", "cal.yaml"], ["-o", "x.src", "--json", "own.src"],
                ["-o", "x.src", "--json", "x.src"], ["-o", "x.src", "--json", os.path.join(os.getcwd(), "x.src")]):
    code, said, warned = run(*base, "--targets", "own.src", *start, *outputs)
    if code != 2 or os.path.exists("x.src") or read("own.src") != src: fail(outputs, code, warned)
# A link stays one, its target is written with the mode that it had; standard output is no file to be replaced.
write("there.src", "old")
os.chmod("there.src", 0o640)
os.symlink("there.src", "link.src")
done(*base, "--targets", "own.src", *start, "-o", "link.src", "--quiet")
if not os.path.islink("link.src") or read("there.src") != read("out.src") or os.stat("there.src").st_mode & 0o777 != 0o640: fail("link.src")
code, said, warned = run(*base, "--targets", "own.src", *start, "-o", "/dev/fd/1", "--quiet")
if code or said.encode() != open("out.src", "rb").read().replace(b"\r\n", b"\n"): fail("/dev/fd/1", code, said, warned)
code, said, warned = run(*base, "--targets", "own.src", *start, "-o", "none/x.src")
if code != 1 or "none/x.src: cannot be written" not in warned: fail(code, warned)

# A table that is called .dat is a table.
write("table.dat", read("t.csv"))
done(*base, "--targets", "table.dat", "-o", "table.out", "--quiet")
if read("table.out") != read("c.csv"): fail("table.dat")

# --- ABB: quaternions and quadrants
abb = root + "/host/robots/abb-irb120.yaml"
limits = [(-165, 165), (-110, 110), (-110, 70), (-160, 160), (-120, 120), (-400, 400)]
joints = []
while len(joints) < n:
    p = [round(dice.uniform(a + 3, b - 3), 4) for a, b in limits]
    if abs(p[4]) > 15: joints.append(p)
write("t.csv", ",".join(q) + "\n" + "".join(",".join("%.4f" % v for v in p) + "\n" for p in joints))
base = ["compensate", "--robot", abb, "--calibration", "cal.yaml"]
done(*base, "--targets", "t.csv", "-o", "c.csv", "--quiet")
done("predict", "--robot", abb, "--joints", "t.csv", "-o", "p.csv", "--quiet")
done("predict", "--robot", abb, "--joints", "c.csv", "-o", "pc.csv", "--quiet")
corrected, nominal, reached = rows("c.csv"), rows("p.csv"), rows("pc.csv")
module = ["MODULE Weld\n  ! robtarget old:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n",
          "  PERS tooldata torch:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]];\n",
          "  CONST speeddata slow:=[50,20,5000,1000];\n  CONST string s:=\"[[1,2,3,4,5,6],[1,2,3,4,5,6]]\";\n"]
def cfx(p, r):  # the table of ABB's manual: wrist centre behind axis 1, behind the lower arm, axis 5 negative
    m = matrix(*(float(r[c]) for c in quat))
    w = [float(r[c]) - sum(m[k][i] * t for i, t in enumerate((10, 30, 60 + 72))) for k, c in enumerate(xyz)]
    ahead = math.cos(math.radians(p[0])) * w[0] + math.sin(math.radians(p[0])) * w[1]
    s, c = math.sin(math.radians(p[1])), math.cos(math.radians(p[1]))
    behind = s * (w[2] - 290 - 270 * c) - c * (ahead - 270 * s) > 0
    return 4 * (ahead < 0) + 2 * behind + (p[4] < 0)
seen_cfx = set()
for k, p in enumerate(joints):
    if k % 3: seen_cfx.add(cfx(p, nominal[k]))
    if k % 3 == 0:
        module.append("  CONST jointtarget j%d:=[[%s],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];\n" % (k, ",".join("%.4f" % v for v in p)))
    else:
        cf = [math.floor(p[j] / 90) for j in (0, 3, 5)] + [cfx(p, nominal[k])]
        module.append("  CONST robtarget p%d := [ [%s], [%s],\n    [%d,%d,%d,%d],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];\n" % (
            k, ",".join(nominal[k][c] for c in xyz), ",".join(nominal[k][c] for c in quat), *cf))
write("weld.mod", "".join(module) + "  MoveAbsJ [[1,2,3,4,30,6],[9E9,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,v100,z10,torch;\nENDMODULE\n")
done(*base, "--targets", "weld.mod", "--start", "0,0,0,0,30,0", "-o", "out.mod")
after = read("out.mod")
for piece in module[:3]:
    if piece not in after: fail("changed:", piece)
if "MoveAbsJ [[1,2,3" in after: fail("the inline target is as it was")
on_branch = 0
for k in range(n):
    if k % 3 == 0:
        got = [float(v) for v in re.search(r"j%d:=\[\[(.*?)\]" % k, after).group(1).split(",")]
        if max(abs(a - float(corrected[k][c])) for a, c in zip(got, q)) > 1e-6: fail("j%d" % k, got)
        continue
    numbers = [float(v) for v in re.findall(NUMBER, re.search(r"p%d := (.*?);" % k, after, re.S).group(1))]
    off = max(abs(a - float(reached[k][c])) for a, c in zip(numbers, xyz))
    same = max(abs(a - float(reached[k][c])) for a, c in zip(numbers[3:7], quat))
    if off < 2e-5 and same < 1e-7: on_branch += 1
    elif off > 5: fail("p%d" % k, numbers)
print(on_branch, "of", n - n // 3, "robtargets on the branch they were made on")
if on_branch != n - n // 3 or len(seen_cfx) < 5: fail("branches", on_branch, seen_cfx)
refuses("r.mod", "CONST robtarget p:=[[300,0,400],[1,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", says=("r.mod:1", "norm"), robot=abb)
refuses("r.mod", "MODULE M\nENDMODULE\n", says=("r.mod", "targets"), robot=abb)
# An array of targets; a target beyond a limit is said by name and left.
write("many.mod", "CONST jointtarget a{2}:=[[[1,2,3,4,50,6],[0,0,0,0,0,0]],[[1,2,3,4,500,6],[0,0,0,0,0,0]]];\n")
said = done(*base, "--targets", "many.mod", "-o", "many_out.mod")
if "many.mod:1: a is refused" not in said or "1 of them ok" not in said: fail("many.mod", said)
if "[1.0,2.0,3.0,4.0,500.0,6.0]" not in read("many_out.mod"): fail(read("many_out.mod"))

# --- Stäubli
write("tx.yaml", "effects:\n  - {effect: joint_compliance, joint: 2, rad_per_nm: 2.0e-5}\ngeometric: [{link: 3, theta_deg: 0.05}]\n")
tx = root + "/host/robots/tx60l.yaml"
dtx = '<?xml version="1.0" encoding="utf-8" ?>\n<Database>\n <Datas>\n  <!-- <Value key="0" j1="1" j2="1" j3="1" j4="1" j5="1" j6="1"/> -->\n' \
      '  <Data name="jHome" access="public" xsi:type="array" type="jointRx" size="2">\n' \
      '   <Value key="0" j1="10" j2="-20.5" j3="100" j4="0" j5="45" j6="0"/>\n   <Value j6=\'7\' key="1" j5="50" j4="3" j3="90" j2="5" j1="-3"/>\n  </Data>\n' \
      '  <Data name="pWeld" type="pointRx" size="1"><Value key="0" x="300" y="0" z="2" rx="0" ry="180" rz="0" shoulder="lefty" elbow="epositive" wrist="wpositive" fatherId="world[0]"/></Data>\n </Datas>\n</Database>\n'
write("weld.dtx", dtx)
write("t.csv", ",".join(q) + "\n10,-20.5,100,0,45,0\n-3,5,90,3,50,7\n")
base = ["compensate", "--robot", tx, "--calibration", "tx.yaml"]
said = done(*base, "--targets", "weld.dtx", "-o", "out.dtx")
if "1 Cartesian points are left" not in said: fail(said)
done(*base, "--targets", "t.csv", "-o", "c.csv", "--quiet")
after = read("out.dtx")
blank = lambda t: re.sub(r"(j[1-6]=.)[-.\d]+", r"\1n", t)
if blank(after) != blank(dtx) or 'j1="1" j2="1"' not in after: fail("out.dtx", after)
for r, line in zip(rows("c.csv"), [l for l in after.split("\n") if "<Value" in l and "<!--" not in l]):
    for j in range(6):
        if abs(float(re.search("j%d=.(%s)" % (j + 1, NUMBER), line).group(1)) - float(r[q[j]])) > 1e-6: fail(line, r)
write("x.txt", dtx)
done(*base, "--targets", "x.txt", "--format", "val3", "-o", "x_out.txt", "--quiet")
if read("x_out.txt") != after: fail("--format")
finish()
