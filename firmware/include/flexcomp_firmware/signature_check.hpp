// SPDX-License-Identifier: Apache-2.0
/// \file
/// Checks the signature of an image or of a signed command (flexcomp/signature.hpp) in slices. Ed25519 itself is the
/// integrator's function: a library's, or the platform's.
#ifndef FLEXCOMP_FIRMWARE_SIGNATURE_CHECK_HPP
#define FLEXCOMP_FIRMWARE_SIGNATURE_CHECK_HPP

#include <array>
#include <cstdint>

#include "flexcomp/sha256.hpp"
#include "flexcomp/signature.hpp"
#include "flexcomp/status.hpp"

namespace flexcomp {
namespace firmware {

/// Whose signatures count. Without keys no signature is asked for.
struct Trust {
  void* user = nullptr;                                      ///< given to `check`
  const std::uint8_t (*keys)[signing::key_bytes] = nullptr;  ///< public keys, not copied
  std::uint16_t count = 0;                                   ///< of the keys
  /// Ed25519 (RFC 8032, 5.1.7): 1 where the signature belongs to key and message; 2 where it needs more time, then the same call
  /// comes again; anything else: it does not.
  int (*check)(void* user, const std::uint8_t* public_key, const std::uint8_t* signature,
               const std::uint8_t* message, std::uint32_t size) = nullptr;
};

/// One check. The bytes must stay where they are until it has ended.
class SignatureCheck {
 public:
  /// Begins with `end` bytes, which the signature follows. A key that is not trusted: Refusal::unknown_key.
  Refusal begin(const Trust& trust, Signed what, const std::uint8_t* bytes, std::uint32_t end,
                const std::uint8_t* key_id);
  /// The next slice, at most 20,000 instructions of a Cortex-M7 or one call of Trust::check; true where it was the last
  /// one: `refusal` is then the verdict.
  bool advance(const Trust& trust, Refusal& refusal);

 private:
  const std::uint8_t* bytes_ = nullptr;
  std::uint32_t end_ = 0;
  std::uint32_t at_ = 0;
  std::uint32_t calls_ = 0;  ///< of Trust::check
  std::uint16_t key_ = 0;
  bool has_message_ = false;
  Signed what_ = Signed::set;
  Sha256 sha_{};
  std::array<std::uint8_t, signing::message_bytes> message_{};
};

}  // namespace firmware
}  // namespace flexcomp

#endif
