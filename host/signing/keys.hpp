// SPDX-License-Identifier: Apache-2.0
/// \file
/// Ed25519 keys (RFC 8032) and their files, by OpenSSL: private keys as PKCS#8, public ones as SubjectPublicKeyInfo, both PEM
/// (RFC 7468, RFC 8410), so that other programs read and make them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "flexcomp/signature.hpp"

// Of OpenSSL, whose headers only this module includes.
struct evp_pkey_st;

namespace flexcomp::host {

using PublicKey = std::array<std::uint8_t, signing::key_bytes>;
using KeyId = std::array<std::uint8_t, signing::key_id_bytes>;
using Signature = std::array<std::uint8_t, signing::signature_bytes>;

/// Id of a public key: the first 8 bytes of its SHA-256.
inline KeyId id_of(const PublicKey& key) { return key_id(key.data()); }

/// 16 hexadecimal digits.
std::string text(const KeyId& id);

/// Ends OpenSSL's hold on a key.
struct FreeKey {
  void operator()(evp_pkey_st* key) const;
};

/// A private key with its public one.
class SigningKey {
 public:
  /// A new key from the system's random numbers. \throws std::runtime_error
  static SigningKey generate();

  /// The key of a seed of 32 bytes, which is what RFC 8032 calls the private key.
  static SigningKey from_seed(std::span<const std::uint8_t, 32> seed);

  /// Reads a PEM file, which nobody but its owner may read. An encrypted one is opened by the passphrase in the environment
  /// variable FLEXCOMP_KEY_PASSPHRASE, or one that is asked for on the terminal.
  /// \throws InputError  absent, no PEM, damaged, a public key, of another algorithm, readable by others, wrong passphrase
  static SigningKey read(const std::string& path);

  /// Writes the private key to `path`, readable by its owner alone, and the public one to `path`.pub. Existing files stay as
  /// they are: neither is then written. \throws InputError  one of them exists \throws std::runtime_error
  void write(const std::string& path) const;

  const PublicKey& public_key() const { return public_key_; }
  KeyId id() const { return id_of(public_key_); }

  /// Ed25519, without a hash before or a context (RFC 8032, 5.1.6).
  Signature sign(std::span<const std::uint8_t> message) const;

 private:
  explicit SigningKey(evp_pkey_st* key);

  std::unique_ptr<evp_pkey_st, FreeKey> key_;
  PublicKey public_key_{};
};

/// Reads a public key. \throws InputError  absent, no PEM, damaged, of another algorithm, a private key
PublicKey read_public_key(const std::string& path);

/// Whether a signature of a message is that of this key.
bool verify(const PublicKey& key, std::span<const std::uint8_t> message, const Signature& signature);

}  // namespace flexcomp::host
