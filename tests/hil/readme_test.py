#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What README.md shows is true: its commands are run and must print what stands there, its code compiles."""
import os, re, shown, subprocess, sys, tempfile
root, programs = os.environ["FLEXCOMP_SOURCE_DIR"], os.environ["FLEXCOMP_BIN_DIR"]
work = tempfile.TemporaryDirectory()
shown.stand_in(work.name, root, programs)
text = open(root + "/README.md", encoding="utf-8").read()
failed, _ = shown.run(text, least=5)

for mark, language, compiler in (("c", "c", ["gcc", "-std=c99"]), ("c++", "cpp", ["g++", "-std=c++17", "-x", "c++"])):
    code = re.findall(r"^<!-- compile " + re.escape(mark) + r" -->\n```" + language + r"\n(.*?)^```$", text, re.M | re.S)
    if len(code) != 1: sys.exit("README.md: %d examples in %s" % (len(code), mark))
    extra = ["-x", "c"] if mark == "c" else []
    run = subprocess.run(compiler + extra + ["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", "-I" + root + "/include",
                         "-I" + root + "/firmware/include", "-isystem", "/usr/include/eigen3", "-"], input=code[0], text=True)
    failed |= run.returncode != 0
    print("ok:" if run.returncode == 0 else "FAILED:", "the example in", mark)
failed |= shown.links(text, root)
sys.exit(failed)
