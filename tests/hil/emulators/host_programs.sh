# shellcheck shell=bash
# Sourced: leaves with ctest's "skipped" where a host program is missing.
for program in flexcomp flexcomp-plant; do
  if ! [ -x "$FLEXCOMP_BIN_DIR/$program" ]; then
    echo "SKIPPED: $FLEXCOMP_BIN_DIR/$program is not there (cmake --preset host && cmake --build --preset host)"
    exit 77
  fi
done
