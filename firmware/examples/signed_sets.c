/* SPDX-License-Identifier: Apache-2.0 */
/* A controller that uses signed sets only: the function that checks a signature, the key, and the call that makes both count.
 * Here OpenSSL checks; on a controller without it, Monocypher does with one line in place of this function's body:
 *
 *     return crypto_ed25519_check(signature, public_key, message, size) == 0;
 *
 * Ends with 0 where the unsigned set of tx60l_set.h is refused, and that for want of a signature. */
#include <openssl/evp.h>

#include "flexcomp.h"
#include "tx60l.h"
#include "tx60l_set.h"

/* `flexcomp trust KEY.pub -o` writes this as a header; here the key of RFC 8032, 7.1, test 1. */
static const uint8_t trusted_keys[1][32] = {{0xD7, 0x5A, 0x98, 0x01, 0x82, 0xB1, 0x0A, 0xB7, 0xD5, 0x4B, 0xFE,
                                             0xD3, 0xC9, 0x64, 0x07, 0x3A, 0x0E, 0xE1, 0x72, 0xF3, 0xDA, 0xA6,
                                             0x23, 0x25, 0xAF, 0x02, 0x1A, 0x68, 0xF7, 0x07, 0x51, 0x1A}};

static int check_signature(void* user, const uint8_t* public_key, const uint8_t* signature,
                           const uint8_t* message, size_t size) {
  EVP_PKEY* key = EVP_PKEY_new_raw_public_key(EVP_PKEY_ED25519, NULL, public_key, 32);
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  int is_right = 0;
  (void)user;
  if (key != NULL && context != NULL && EVP_DigestVerifyInit(context, NULL, NULL, NULL, key) == 1)
    is_right = EVP_DigestVerify(context, signature, 64, message, size) == 1;
  EVP_MD_CTX_free(context);
  EVP_PKEY_free(key);
  return is_right;
}

int main(void) {
  static flexcomp_memory memory;
  flexcomp_robot robot = staubli_tx60l;
  flexcomp_trust trust;
  flexcomp_state state;
  flexcomp_arm* fc;
  uint32_t now_ms;

  /* The serial number of this unit, from where its maker keeps it: sets are signed for one unit. */
  robot.serial = "F07-26A1-A-01";
  fc = flexcomp_init(&memory, sizeof memory, &robot, NULL, NULL);
  if (fc == NULL) return 1;
  trust.user = NULL;
  trust.keys = trusted_keys;
  trust.count = 1;
  trust.check = check_signature;
  if (!flexcomp_set_trust(fc, &trust)) return 2;
  flexcomp_boot(fc);

  if (flexcomp_stage_begin(fc, sizeof tx60l_image) != 0) return 3;
  if (flexcomp_stage_write(fc, 0, tx60l_image, sizeof tx60l_image) != 0) return 4;
  if (flexcomp_stage_verify(fc) != 0) return 5;
  for (now_ms = 0; now_ms < 100; ++now_ms) flexcomp_poll(fc, now_ms);
  flexcomp_get_state(fc, &state);
  /* 25: the controller accepts only what is signed; flexcomp_refusal_text says so. */
  return state.refusal == 25 && state.active_sequence == 0 ? 0 : 6;
}
