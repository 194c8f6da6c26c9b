// SPDX-License-Identifier: Apache-2.0
/// \file
/// What is signed, with Ed25519 (RFC 8032), so that a controller knows who sends a set or a command: the message of a
/// signature, the signature record of an image, and the signed command. The algorithm itself is not here: the host
/// has a library for it, a controller the function that its integrator gives (docs/security.md).
///
///     signature record of an image (image.hpp), its last one, 84 bytes
///       0 u8  1: Ed25519, then 3 bytes 0
///       4 u64 counter: never used twice for one unit, and higher than all before
///      12 key id, 8 bytes: the first of the SHA-256 of the public key
///      20 signature, 64 bytes
///
///     signed command, 132 bytes; it goes to staging as an image does, and is verified as one
///       0 "FLXA"
///       4 u16 1
///       6 u16 command (wire::Command): rollback or restore_defaults
///       8 u32 CRC-32 of the set that is active, 0: none
///      12 u32 0
///      16 u64 counter
///      24 SHA-256 of the unit's serial number, 32 bytes
///      56 key id, 8 bytes
///      64 signature, 64 bytes
///     128 u32 CRC-32 of all before
///
/// The message that is signed has 48 bytes: 16 that say what it is ("flexcomp-set-1" or "flexcomp-cmd-1", filled up with
/// zeros), and the SHA-256 of all bytes of the image or command before the signature.
#ifndef FLEXCOMP_SIGNATURE_HPP
#define FLEXCOMP_SIGNATURE_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/bytes.hpp"
#include "flexcomp/crc32.hpp"
#include "flexcomp/image.hpp"
#include "flexcomp/sha256.hpp"

namespace flexcomp {

/// Constants of the layouts; see the tables at the top.
namespace signing {
constexpr std::size_t key_bytes = 32;         ///< of a public key
constexpr std::size_t key_id_bytes = 8;       ///< of its id
constexpr std::size_t signature_bytes = 64;   ///< of a signature
constexpr std::size_t message_bytes = 48;     ///< of what is signed
constexpr std::uint8_t ed25519 = 1;           ///< the only algorithm
constexpr std::size_t record_counter = 4;     ///< offset in the record
constexpr std::size_t record_key_id = 12;     ///< offset in the record
constexpr std::size_t record_signature = 20;  ///< offset in the record

constexpr std::size_t command_bytes = 132;     ///< of a signed command
constexpr std::size_t command_number = 6;      ///< offset
constexpr std::size_t command_active_crc = 8;  ///< offset
constexpr std::size_t command_counter = 16;    ///< offset
constexpr std::size_t command_unit = 24;       ///< offset
constexpr std::size_t command_key_id = 56;     ///< offset
constexpr std::size_t command_signature = 64;  ///< offset
constexpr std::size_t command_crc = 128;       ///< offset
}  // namespace signing

/// What a signature is for.
enum class Signed : std::uint8_t {
  set,     ///< an image
  command  ///< a signed command
};

/// What a public key is called in images: the first 8 bytes of its SHA-256.
inline std::array<std::uint8_t, signing::key_id_bytes> key_id(const std::uint8_t* public_key) {
  const Sha256Digest digest = sha256(public_key, signing::key_bytes);
  std::array<std::uint8_t, signing::key_id_bytes> id{};
  for (std::size_t k = 0; k < id.size(); ++k) id[k] = digest[k];
  return id;
}

/// The message that is signed, from the digest of all bytes before the signature.
inline std::array<std::uint8_t, signing::message_bytes> signed_message(Signed what,
                                                                       const Sha256Digest& digest) {
  constexpr char set[] = "flexcomp-set-1";
  constexpr char command[] = "flexcomp-cmd-1";
  std::array<std::uint8_t, signing::message_bytes> message{};
  for (std::size_t k = 0; k + 1 < sizeof set; ++k)
    message[k] = static_cast<std::uint8_t>(what == Signed::set ? set[k] : command[k]);
  for (std::size_t k = 0; k < digest.size(); ++k) message[16 + k] = digest[k];
  return message;
}

/// True where the second half of a signature is below the order of the group (RFC 8032, 5.1.7). Whoever accepts others accepts two
/// signatures for one message.
inline bool is_canonical_signature(const std::uint8_t* signature) {
  // 2^252 + 27742317777372353535851937790883648493, most significant byte first.
  constexpr std::uint8_t order[32] = {0x10, 0,    0,    0,    0,    0,    0,    0,    0,    0,    0,
                                      0,    0,    0,    0,    0,    0x14, 0xDE, 0xF9, 0xDE, 0xA2, 0xF7,
                                      0x9C, 0xD6, 0x58, 0x12, 0x63, 0x1A, 0x5C, 0xF5, 0xD3, 0xED};
  for (std::size_t k = 0; k < 32; ++k) {
    const std::uint8_t byte = signature[63 - k];
    if (byte != order[k]) return byte < order[k];
  }
  return false;
}

/// Offset of what is signed last in a signed image of `size` bytes: its signature.
constexpr std::size_t signature_offset(std::size_t size) {
  return size - image::crc_bytes - signing::signature_bytes;
}

/// Size of an image after a signature record has been appended.
constexpr std::size_t signed_size(std::size_t size) {
  return size + image::record_head_bytes + image::signature_bytes;
}

/// Appends a signature record without its signature to an image of `size` bytes that has none, in a buffer of
/// signed_size(size). SHA-256 over the bytes before signature_offset() then makes the message, and put_signature() ends it.
inline void append_signature(std::uint8_t* bytes, std::size_t size, std::uint64_t counter,
                             const std::array<std::uint8_t, signing::key_id_bytes>& key) {
  bytes[5] = image::schema_minor;
  store_u32(bytes + 8, static_cast<std::uint32_t>(signed_size(size)));
  std::uint8_t* p = bytes + size - image::crc_bytes;
  store_u16(p, image::record_signature);
  store_u16(p + 2, static_cast<std::uint16_t>(image::signature_bytes));
  p += image::record_head_bytes;
  store_u32(p, signing::ed25519);
  store_u64(p + signing::record_counter, counter);
  for (std::size_t k = 0; k < key.size(); ++k) p[signing::record_key_id + k] = key[k];
}

/// Writes the signature into a signed image of `size` bytes, and its CRC-32.
inline void put_signature(std::uint8_t* bytes, std::size_t size, const std::uint8_t* signature) {
  for (std::size_t k = 0; k < signing::signature_bytes; ++k) bytes[signature_offset(size) + k] = signature[k];
  store_u32(bytes + size - image::crc_bytes, crc32(bytes, size - image::crc_bytes));
}

/// A command that a key permits once; see the table at the top.
struct SignedCommand {
  std::uint16_t command = 0;                                 ///< wire::Command
  std::uint32_t active_crc = 0;                              ///< of the set that it is for, 0: none
  std::uint64_t counter = 0;                                 ///< higher than all before
  Sha256Digest unit_hash{};                                  ///< of the serial number
  std::array<std::uint8_t, signing::key_id_bytes> key_id{};  ///< of the public key
};

/// Writes a signed command without its signature into `out`, of signing::command_bytes. SHA-256 over the bytes before
/// signing::command_signature makes the message; then the signature follows, and the CRC-32.
inline void encode(const SignedCommand& c, std::uint8_t* out) {
  out[0] = 'F';
  out[1] = 'L';
  out[2] = 'X';
  out[3] = 'A';
  store_u16(out + 4, 1);
  store_u16(out + signing::command_number, c.command);
  store_u32(out + signing::command_active_crc, c.active_crc);
  store_u32(out + 12, 0);
  store_u64(out + signing::command_counter, c.counter);
  for (std::size_t k = 0; k < 32; ++k) out[signing::command_unit + k] = c.unit_hash[k];
  for (std::size_t k = 0; k < 8; ++k) out[signing::command_key_id + k] = c.key_id[k];
}

/// True where bytes begin as a signed command does.
inline bool looks_like_command(const std::uint8_t* bytes, std::size_t size) {
  return size >= 4 && bytes[0] == 'F' && bytes[1] == 'L' && bytes[2] == 'X' && bytes[3] == 'A';
}

/// Reads a signed command; its signature is not checked here.
inline Refusal decode(const std::uint8_t* bytes, std::size_t size, SignedCommand& c) {
  if (size != signing::command_bytes) return Refusal::bad_length;
  if (crc32(bytes, signing::command_crc) != load_u32(bytes + signing::command_crc)) return Refusal::checksum;
  if (load_u16(bytes + 4) != 1 || load_u32(bytes + 12) != 0) return Refusal::schema;
  c.command = load_u16(bytes + signing::command_number);
  c.active_crc = load_u32(bytes + signing::command_active_crc);
  c.counter = load_u64(bytes + signing::command_counter);
  for (std::size_t k = 0; k < 32; ++k) c.unit_hash[k] = bytes[signing::command_unit + k];
  for (std::size_t k = 0; k < 8; ++k) c.key_id[k] = bytes[signing::command_key_id + k];
  return Refusal::none;
}

}  // namespace flexcomp

#endif
