#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# docs/files.md: its examples run as they stand there, and no key of a reader is missing.
set -euo pipefail
source=${FLEXCOMP_SOURCE_DIR:?} bin=${FLEXCOMP_BIN_DIR:?}
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
cd -- "$work"
mkdir -p build/host
ln -s "$bin" build/host/bin
PYTHONDONTWRITEBYTECODE=1 /usr/bin/python3 "$source/tests/hil/files_page.py" "$source"
