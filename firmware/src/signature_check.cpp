// SPDX-License-Identifier: Apache-2.0
#include "flexcomp_firmware/signature_check.hpp"

#include <cstring>

namespace flexcomp {
namespace firmware {

namespace {
constexpr std::uint32_t hashed_at_once = 64;  ///< bytes: one compression
constexpr std::uint32_t most_calls = 100000;  ///< of a function that needs more time
}  // namespace

Refusal SignatureCheck::begin(const Trust& trust, Signed what, const std::uint8_t* bytes, std::uint32_t end,
                              const std::uint8_t* id) {
  bytes_ = bytes;
  end_ = end;
  at_ = 0;
  calls_ = 0;
  what_ = what;
  has_message_ = false;
  sha_ = Sha256();
  for (key_ = 0; key_ < trust.count; ++key_) {
    if (std::memcmp(key_id(trust.keys[key_]).data(), id, signing::key_id_bytes) == 0) return Refusal::none;
  }
  return Refusal::unknown_key;
}

bool SignatureCheck::advance(const Trust& trust, Refusal& refusal) {
  const std::uint8_t* signature = bytes_ + end_;
  for (std::uint32_t n = 0; n < hashed_at_once && at_ < end_; ++n) sha_.update(bytes_[at_++]);
  if (at_ < end_) return false;
  if (!has_message_) {
    message_ = signed_message(what_, sha_.finish());
    has_message_ = true;
    return false;
  }
  refusal = Refusal::wrong_signature;
  if (!is_canonical_signature(signature)) return true;
  const int result =
      trust.check(trust.user, trust.keys[key_], signature, message_.data(), signing::message_bytes);
  if (result == 2 && ++calls_ < most_calls) return false;
  if (result == 1) refusal = Refusal::none;
  return true;
}

}  // namespace firmware
}  // namespace flexcomp
