# SPDX-License-Identifier: Apache-2.0
"""The program as the tests of foreign formats call it, in a folder of their own, and the files that they write and read."""
import csv, os, subprocess, sys, tempfile
work = tempfile.TemporaryDirectory()
os.chdir(work.name)
flexcomp, root = os.environ["FLEXCOMP_BIN_DIR"] + "/flexcomp", os.environ["FLEXCOMP_SOURCE_DIR"]
failures = 0

def run(*arguments):
    r = subprocess.run([flexcomp, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    return r.returncode, r.stdout, r.stderr

def done(*arguments):
    code, said, warned = run(*arguments)
    if code: fail(arguments, code, said, warned)
    return said + warned

def fail(*words):
    global failures
    failures += 1
    print("FAILED:", *words)

def finish():
    print(failures, "failures")
    sys.exit(failures != 0)

def write(path, text, encoding="utf-8"):
    with open(path, "w", encoding=encoding, newline="") as f: f.write(text)

def read(path):
    with open(path, newline="", encoding="utf-8") as f: return f.read()

def rows(path):
    with open(path, newline="") as f: return list(csv.DictReader(f))

def matrix(w, x, y, z):
    return [[1-2*(y*y+z*z), 2*(x*y-w*z), 2*(x*z+w*y)], [2*(x*y+w*z), 1-2*(x*x+z*z), 2*(y*z-w*x)], [2*(x*z-w*y), 2*(y*z+w*x), 1-2*(x*x+y*y)]]

q = ["q%d_deg" % j for j in range(1, 7)]
xyz = ["x_mm", "y_mm", "z_mm"]
quat = ["qw", "qx", "qy", "qz"]
