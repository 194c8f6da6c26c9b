# shellcheck shell=bash disable=SC2034
# What the tests with the emulated Cortex-R5F have in common; sourced.
set -eu
: "${FLEXCOMP_SOURCE_DIR:?}" "${FLEXCOMP_IMAGE:?}" "${FLEXCOMP_BIN_DIR:?}"
here=${BASH_SOURCE[0]%/*}
# The image belongs to a cross build, the programs around it to the host's.
for program in flexcomp flexcomp-plant; do
  if ! [ -x "$FLEXCOMP_BIN_DIR/$program" ]; then
    echo "SKIPPED: $FLEXCOMP_BIN_DIR/$program is not there. First: cmake --preset host && cmake --build --preset host"
    echo "(or set FLEXCOMP_HOST_BIN_DIR to the folder where the programs are)"
    exit 77
  fi
done
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
