#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Keys and signatures against the program openssl: it reads our keys, we read its own, and what is signed is verified by it.
set -u
source "${FLEXCOMP_SOURCE_DIR:?}/tests/host/commands/common.sh"
command -v openssl >openssl.txt || exit 77

expect 0 "key id" keygen -o arm.key --json keygen.json
openssl pkey -in arm.key -pubout | cmp - arm.key.pub || fail "openssl derives another public key"
[ "$(stat -c %a arm.key)" = 600 ] || fail "arm.key has mode $(stat -c %a arm.key)"
id=$(openssl pkey -pubin -in arm.key.pub -outform DER | tail -c 32 | sha256sum | cut -c1-16)
grep -q "\"key_id\": \"$id\"" keygen.json || fail "key id: $(cat keygen.json), expected $id"
expect 0 "$id" trust arm.key.pub -o keys.h
expect 3 "exists; a key is never written over another" keygen -o arm.key
expect 2 "keys is required" trust
expect 3 "arm.key: expected an Ed25519 public key in PEM, found a private key" trust arm.key
expect 3 "found one that was given before" trust arm.key.pub arm.key.pub
expect 2 "another file" trust arm.key.pub -o ./arm.key.pub

# A key that openssl made; the array in C is its 32 bytes, under any compiler.
openssl genpkey -algorithm ED25519 -out theirs.key && openssl pkey -in theirs.key -pubout -out theirs.pub
expect_all 0 "$id" "C array flexcomp_trusted_keys[2]" -- "$flexcomp" trust arm.key.pub theirs.pub -o keys.h
cat >print.c <<'C'
#include <stdio.h>
int main(void) { return fwrite(flexcomp_trusted_keys, 32, 2, stdout) == 2 ? 0 : 1; }
C
cc -std=c99 -Wall -Wextra -Wpedantic -Werror -include ./keys.h print.c -o print && ./print >array.bin
for pub in arm.key.pub theirs.pub; do openssl pkey -pubin -in $pub -outform DER | tail -c 32; done | cmp - array.bin ||
  fail "the array has other bytes"
openssl genrsa -out rsa.key 2048 2>rsa.txt
openssl rsa -in rsa.key -pubout -out rsa.pub 2>rsa.txt
expect 3 "found one of RSA" trust rsa.pub

# A signed set: the message as docs and core have it, its signature verified by openssl. The program signs only what goes to a
# controller, thus the bytes come from a program of the tests.
"${FLEXCOMP_BIN_DIR}/tests/host_signing_tests" --gtest_filter=SignedFiles.ForOpenssl >made.txt || fail "$(cat made.txt)"
for what in set command; do
  [ -s $what.bin ] || fail "no $what.bin"
  if [ $what = set ]; then
    tag=flexcomp-set-1
    before=$(($(stat -c %s set.bin) - 68))
  else
    tag=flexcomp-cmd-1
    before=64
  fi
  { printf '%s\0\0' $tag && head -c $before $what.bin | openssl dgst -sha256 -binary; } >message.bin
  [ "$(stat -c %s message.bin)" = 48 ] || fail "a message of $(stat -c %s message.bin) bytes"
  tail -c +$((before + 1)) $what.bin | head -c 64 >signature.bin
  verify=(openssl pkeyutl -verify -rawin -pubin -inkey arm.key.pub -in message.bin -sigfile signature.bin)
  expect_all 0 "Verified Successfully" -- "${verify[@]}"
  # The other way round: what openssl signs are the same bytes.
  openssl pkeyutl -sign -rawin -inkey arm.key -in message.bin | cmp - signature.bin || fail "$what: another signature"
  printf 'x' | dd of=message.bin bs=1 seek=20 conv=notrunc status=none
  expect_all 1 "Signature Verification Failure" -- "${verify[@]}"
done

exit $((failures > 0))
