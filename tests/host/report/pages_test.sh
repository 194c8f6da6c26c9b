#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Pages that the commands make, in a real browser: pages.test.mjs. Installs what drives the browser, as the lock file
# pins it, in the build folder. Skipped (77) where there is no Chromium; ./check installs it.
set -uo pipefail
here=$(cd -- "${BASH_SOURCE[0]%/*}" && pwd)
node=$(command -v node || command -v nodejs) || { echo "no node"; exit 1; }
for name in chromium chromium-browser google-chrome; do
  FLEXCOMP_CHROMIUM=${FLEXCOMP_CHROMIUM:-$(command -v "$name")}
done
[ -n "$FLEXCOMP_CHROMIUM" ] || { echo "SKIPPED: no chromium"; exit 77; }
export FLEXCOMP_CHROMIUM
: "${FLEXCOMP_BIN_DIR:?}" "${FLEXCOMP_SOURCE_DIR:?}"
work=$(dirname "$FLEXCOMP_BIN_DIR")/report-pages
mkdir -p "$work"
if ! cmp -s "$here/package-lock.json" "$work/package-lock.json" || [ ! -e "$work/installed" ]; then
  rm -f "$work/installed"
  cp "$here/package.json" "$here/package-lock.json" "$work" || exit 1
  (cd "$work" && npm ci --ignore-scripts --no-audit --no-fund --prefer-offline --loglevel=error) ||
    { echo "npm could not install what tests/host/report/package-lock.json names; it needs the npm registry once"; exit 1; }
  touch "$work/installed"
fi
# The pages and their pictures stay there to be looked at.
rm -rf "$work/pages"
mkdir "$work/pages"
FLEXCOMP_PAGES=$work/pages FLEXCOMP_PACKAGES=$work exec "$node" --test "$here/pages.test.mjs"
