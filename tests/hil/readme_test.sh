#!/usr/bin/env bash
# What README.md shows is true: its commands are run and must print what stands there, its code compiles.
set -euo pipefail
source=${FLEXCOMP_SOURCE_DIR:?} bin=${FLEXCOMP_BIN_DIR:?}
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
cd -- "$work"
ln -s "$source/host" "$source/hil" "$source/tests" "$source/docs" .
PATH=$bin:$PATH /usr/bin/python3 - "$source" <<'PYTHON'
import re, subprocess, sys
root = sys.argv[1]
text = open(root + "/README.md", encoding="utf-8").read()
failed = False
def blocks(kind):
    return re.findall(r"^```" + re.escape(kind) + r"\n(.*?)^```$", text, re.M | re.S)

for name, body in re.findall(r"^<!-- file (\S+) -->\n```\w*\n(.*?)^```$", text, re.M | re.S):
    open(name, "w").write(body)

commands = 0
for block in blocks("console"):
    for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
        command, *shown = part.rstrip("\n").split("\n")
        commands += 1
        run = subprocess.run(command, shell=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120)
        # Lines in their order; "…" stands for any number of lines, and seconds at the end of a line are not repeated.
        wanted = [line for line in shown if line.strip()]
        lines = iter(run.stdout.split("\n"))
        missing = next((w for w in wanted if w != "…" and not any(have.rstrip().startswith(w.rstrip()) for have in lines)), None)
        good = run.returncode == 0 and missing is None
        failed |= not good
        print("ok:" if good else "FAILED: status %d, not printed: %r" % (run.returncode, missing), command)
        if not good: print(run.stdout)
if commands < 5: sys.exit("README.md has only %d commands: is it still read rightly?" % commands)

same = open("commands.csv").read() == open("answers.csv").read()
failed |= not same
print("ok:" if same else "FAILED:", "answers.csv and commands.csv are the same")

for mark, language, compiler in (("c", "c", ["gcc", "-std=c99"]), ("c++", "cpp", ["g++", "-std=c++17", "-x", "c++"])):
    code = re.findall(r"^<!-- compile " + re.escape(mark) + r" -->\n```" + language + r"\n(.*?)^```$", text, re.M | re.S)
    if len(code) != 1: sys.exit("README.md: %d examples in %s" % (len(code), mark))
    extra = ["-x", "c"] if mark == "c" else []
    run = subprocess.run(compiler + extra + ["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", "-I" + root + "/include",
                         "-I" + root + "/firmware/include", "-isystem", "/usr/include/eigen3", "-"], input=code[0], text=True)
    failed |= run.returncode != 0
    print("ok:" if run.returncode == 0 else "FAILED:", "the example in", mark)
for name in re.findall(r"\]\(([^)#]+)\)", text):
    try: open(root + "/" + name).close()
    except OSError: failed = True; print("FAILED: README.md links to", name)
sys.exit(failed)
PYTHON
