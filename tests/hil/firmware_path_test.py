#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# docs/firmware.md word for word: from README to a linked image, in a copy of this repository. Skipped (77) where there is
# no cross compiler or emulator.
set -euo pipefail
source=${FLEXCOMP_SOURCE_DIR:?} bin=${FLEXCOMP_BIN_DIR:?}
for tool in arm-none-eabi-g++ qemu-system-arm; do
  command -v "$tool" >/dev/null || { echo "SKIPPED: no $tool"; exit 77; }
done
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
tar -C "$source" --exclude=./build --exclude=./.git -cf - . | tar -C "$work" -xf -
cd -- "$work"
mkdir -p build/host
ln -s "$bin" build/host/bin
PYTHONPATH=$source/tests/hil PYTHONDONTWRITEBYTECODE=1 /usr/bin/python3 - "$source" <<'PYTHON'
import shown, sys
root = sys.argv[1]
text = open(root + "/docs/firmware.md", encoding="utf-8").read()
failed, _ = shown.run(text, least=10, seconds=540)
failed |= shown.links(text, root + "/docs")
sys.exit(failed)
PYTHON
