# SPDX-License-Identifier: Apache-2.0
"""What a page of the documentation shows is true: its commands are run as they stand there, in order, in one shell, and must
print what is printed under them."""
import os, re, signal, subprocess

def stand_in(work, root, programs):
    """Enters a folder that looks like this repository after a build, to whoever only reads it."""
    os.chdir(work)
    for name in ("host", "hil", "tests", "docs"): os.symlink(os.path.join(root, name), name)
    os.makedirs("build/host")
    os.symlink(programs, "build/host/bin")

def blocks(text, kind):
    return re.findall(r"^```" + re.escape(kind) + r"\n(.*?)^```$", text, re.M | re.S)

def commands(text):
    """(command, lines shown under it) of all console blocks; a backslash at the end of a line goes on in the next one."""
    found = []
    for block in blocks(text, "console"):
        for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
            lines = part.rstrip("\n").split("\n")
            command = [lines.pop(0)]
            while command[-1].endswith("\\"): command.append(lines.pop(0))
            found.append(("\n".join(command), lines))
    return found

def run(text, least, seconds=200):
    """Runs all commands of a page. Returns (whether something failed, all that was printed)."""
    for name, body in re.findall(r"^<!-- file (\S+) -->\n```\w*\n(.*?)^```$", text, re.M | re.S): open(name, "w").write(body)
    shown = commands(text)
    if len(shown) < least: raise SystemExit("only %d commands: is the page still read rightly?" % len(shown))
    # Behind each command its number and status; the next one finds the status where it would find it in a shell.
    script = "".join("%s\n__status=$?; printf '\\n\\001%d %%d\\n' $__status; (exit $__status)\n" % (command, k)
                     for k, (command, _) in enumerate(shown))
    with open("shown.out", "w") as out:
        shell = subprocess.Popen(["bash", "-c", script], stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT, start_new_session=True)
        try: shell.wait(timeout=seconds)
        except subprocess.TimeoutExpired: print("FAILED: not done after %d s" % seconds)
        finally:
            try: os.killpg(shell.pid, signal.SIGTERM)  # what still runs in the background
            except ProcessLookupError: pass
    printed = open("shown.out", encoding="utf-8", errors="replace").read()
    failed, rest = False, printed
    for k, (command, lines) in enumerate(shown):
        piece = re.match(r"(.*?)\n?\001%d (\d+)\n" % k, rest, re.S)
        if not piece:
            print("FAILED: did not end:", command, rest, sep="\n")
            return True, printed
        rest = rest[piece.end():]
        # Lines in their order; "…" stands for any number of lines, and seconds at the end of a line are not repeated. Where a
        # progress bar was drawn, on a console and a busy machine, what erases it stands before the next line.
        have = iter(piece[1].replace("\033[K", "").split("\n"))
        missing = next((w for w in lines if w.strip() not in ("", "…") and not any(h.rstrip().startswith(w.rstrip()) for h in have)), None)
        # A page that shows a status says so by its next command.
        status_shown = k + 1 < len(shown) and shown[k + 1][0] == "echo $?"
        good = missing is None and (piece[2] == "0" or status_shown)
        failed |= not good
        print("ok:" if good else "FAILED: status %s, not printed: %r" % (piece[2], missing), command)
        if not good: print(piece[1])
    return failed, printed

def links(text, folder):
    """Whether a link to a file of ours leads nowhere."""
    failed = False
    for name in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text):
        if "://" not in name and not os.path.exists(os.path.join(folder, name)):
            failed = True
            print("FAILED: a link to", name)
    return failed
