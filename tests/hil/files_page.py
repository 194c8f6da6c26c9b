# SPDX-License-Identifier: Apache-2.0
"""docs/files.md word for word: its examples are run in order, and every key and column that a reader of ours knows is on it.
files_page.py ROOT, in a folder where build/host/bin leads to the programs."""
import re, sys
from pathlib import Path

import shown

root = Path(sys.argv[1])
text = (root / "docs/files.md").read_text(encoding="utf-8")
failed, _ = shown.run(text, least=8)

tables = "\n".join(line for line in text.split("\n") if line.startswith("|"))
documented = set(re.findall(r"[A-Za-z_]\w*", " ".join(re.findall(r"`([^`]+)`", tables))))
documented |= {key for base in ("geometric", "base", "tool") for key in ("link", base)}

known = set()
for name in ("robot_file", "cell_file", "capsule", "tolerance_file", "calibration_file"):
    source = (root / "host/files" / (name + ".cpp")).read_text(encoding="utf-8")
    for keys in re.findall(r"require_keys\(\s*\{([^}]*)\}", source): known |= set(re.findall(r'"(\w+)"', keys))
data = (root / "host/files/data_file.cpp").read_text(encoding="utf-8")
columns = re.findall(r'\bvisit\("(\w+)"', data)
if len(known) < 30 or len(columns) < 5: sys.exit("only %d keys, %d columns: are the readers still read rightly?" % (len(known), len(columns)))
for key in sorted((known | set(columns)) - documented):
    failed = True
    print("FAILED: docs/files.md has no", key)
failed |= shown.links(text, str(root / "docs"))
sys.exit(failed)
