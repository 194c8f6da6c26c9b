#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""docs/firmware.md word for word: from README to a linked image, in a copy of this repository. Skipped (77) where there is
no cross compiler or emulator."""
import os, shown, shutil, sys, tempfile
for tool in ("arm-none-eabi-g++", "qemu-system-arm"):
    if not shutil.which(tool):
        print("SKIPPED: no", tool)
        sys.exit(77)
root, programs = os.environ["FLEXCOMP_SOURCE_DIR"], os.environ["FLEXCOMP_BIN_DIR"]
work = tempfile.TemporaryDirectory()
copy = os.path.join(work.name, "flexcomp")
shutil.copytree(root, copy, symlinks=True,
                ignore=lambda folder, names: {"build", ".git"} & set(names) if folder == root else set())
os.makedirs(copy + "/build/host")
os.symlink(programs, copy + "/build/host/bin")
os.chdir(copy)
text = open(root + "/docs/firmware.md", encoding="utf-8").read()
failed, _ = shown.run(text, least=10, seconds=540)
failed |= shown.links(text, root + "/docs")
sys.exit(failed)
