// SPDX-License-Identifier: Apache-2.0
#include "signing/signed_bytes.hpp"

#include <algorithm>

#include "flexcomp/crc32.hpp"
#include "flexcomp/image.hpp"
#include "input_error.hpp"
#include "model/parameter_image.hpp"

namespace flexcomp::host {

namespace {

using Bytes = std::vector<std::uint8_t>;
using Message = std::array<std::uint8_t, signing::message_bytes>;

Message message_of(Signed what, std::span<const std::uint8_t> before_signature) {
  return signed_message(what, sha256(before_signature.data(), before_signature.size()));
}

bool has_signature(Signed what, std::span<const std::uint8_t> bytes, std::size_t at, const PublicKey& key) {
  Signature signature{};
  std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), signature.size(), signature.begin());
  return is_canonical_signature(signature.data()) &&
         verify(key, message_of(what, bytes.first(at)), signature);
}

std::uint64_t in_ms(std::chrono::system_clock::time_point t) {
  // C++20: the epoch of this clock is that of Unix.
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(t.time_since_epoch()).count();
  return ms < 0 ? 0 : static_cast<std::uint64_t>(ms);
}

}  // namespace

Bytes sign_image(std::span<const std::uint8_t> image, const SigningKey& key, std::uint64_t counter,
                 const std::string& source) {
  Bytes out = without_signature(image, source);
  const std::size_t size = out.size();
  out.resize(signed_size(size));
  append_signature(out.data(), size, counter, key.id());
  const auto message =
      message_of(Signed::set, std::span<const std::uint8_t>(out).first(signature_offset(out.size())));
  put_signature(out.data(), out.size(), key.sign(message).data());
  return out;
}

bool is_signed_by(std::span<const std::uint8_t> image, const PublicKey& key) {
  try {
    const ImageRecords records = image_records(image, "");
    if (!records.is_signed || records.key_id != id_of(key)) return false;
  } catch (const InputError&) {
    return false;
  }
  const std::size_t crc_at = image.size() - image::crc_bytes;
  return crc32(image.data(), crc_at) == load_u32(image.data() + crc_at) &&
         has_signature(Signed::set, image, signature_offset(image.size()), key);
}

Bytes sign_command(SignedCommand command, const SigningKey& key) {
  command.key_id = key.id();
  Bytes out(signing::command_bytes);
  encode(command, out.data());
  const auto message =
      message_of(Signed::command, std::span<const std::uint8_t>(out).first(signing::command_signature));
  const Signature signature = key.sign(message);
  std::copy(signature.begin(), signature.end(), out.begin() + signing::command_signature);
  store_u32(out.data() + signing::command_crc, crc32(out.data(), signing::command_crc));
  return out;
}

bool is_command_signed_by(std::span<const std::uint8_t> command, const PublicKey& key) {
  SignedCommand read;
  return looks_like_command(command.data(), command.size()) &&
         decode(command.data(), command.size(), read) == Refusal::none && read.key_id == id_of(key) &&
         has_signature(Signed::command, command, signing::command_signature, key);
}

bool is_plausible_counter(std::uint64_t accepted, std::chrono::system_clock::time_point now) {
  return accepted <= in_ms(now + counter_ahead);
}

std::uint64_t next_counter(std::uint64_t accepted, std::chrono::system_clock::time_point now) {
  const std::uint64_t above = accepted + 1;  // 0 after the last one
  return above == 0 ? 0 : std::max(in_ms(now), above);
}

}  // namespace flexcomp::host
