# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# Sourced by the tests beside it: an empty folder to work in, and what a command must answer.
flexcomp="${FLEXCOMP_BIN_DIR:?}/flexcomp"
root="${FLEXCOMP_SOURCE_DIR:?}"
robot="$root/host/robots/tx60l.yaml"
truth="$root/tests/data/tx60l_table1.yaml"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0

fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}

# absent FILE…: a refused command has left none of them
absent() {
  local file
  for file in "$@"; do [[ ! -e $file ]] || fail "$file was left behind"; done
}

# expect_all STATUS PATTERN… -- COMMAND…: exit status, and every pattern is in what the command says, which is left in out.txt
expect_all() {
  local status=$1 patterns=() pattern got begin=$SECONDS
  shift
  while [[ $1 != -- ]]; do
    patterns+=("$1")
    shift
  done
  shift
  "$@" >out.txt 2>&1
  got=$?
  [[ $got -eq $status ]] || fail "$*: exit status $got, expected $status: $(cat out.txt)"
  for pattern in "${patterns[@]}"; do
    grep -qF -- "$pattern" out.txt || fail "$*: does not say '$pattern': $(cat out.txt)"
  done
  echo "ok: $status ${patterns[*]} ($((SECONDS - begin)) s)"
}

# expect STATUS MESSAGE ARGUMENTS…: the same of flexcomp; an empty message asks for none
expect() { expect_all "$1" ${2:+"$2"} -- "$flexcomp" "${@:3}"; }
