#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What docs/security.md shows is true: its commands are run and must print what stands there."""
import os, shown, sys, tempfile
root, programs = os.environ["FLEXCOMP_SOURCE_DIR"], os.environ["FLEXCOMP_BIN_DIR"]
work = tempfile.TemporaryDirectory()
shown.stand_in(work.name, root, programs)
text = open(root + "/docs/security.md", encoding="utf-8").read()
failed, _ = shown.run(text, least=6)
# The key under a passphrase is opened by it, the array is what a compiler takes.
for command in ("flexcomp push --to can:none --key locked.key --dry-run cal.yaml --robot r.yaml 2>&1 | grep -q 'no interface\\|no CAN'",
                "cc -fsyntax-only -Wall -Wextra -Werror -Wno-unused-variable -xc flexcomp_trusted_key.h"):
    open("cal.yaml", "w").write("geometric: []\n")
    open("r.yaml", "w").write(open("host/robots/tx60l.yaml").read() + "serial: A-1\n")
    environment = dict(os.environ, PATH=programs + ":" + os.environ["PATH"], FLEXCOMP_KEY_PASSPHRASE="correct horse")
    good = os.spawnvpe(os.P_WAIT, "bash", ["bash", "-c", command], environment) == 0
    failed |= not good
    print("ok:" if good else "FAILED:", command)
failed |= shown.links(text, root + "/docs")
sys.exit(failed)
