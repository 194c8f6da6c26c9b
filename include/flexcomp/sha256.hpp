// SPDX-License-Identifier: Apache-2.0
/// \file
/// SHA-256 (FIPS 180-4) without a heap: of the nominal geometry, names, serial numbers, and of what is signed.
#ifndef FLEXCOMP_SHA256_HPP
#define FLEXCOMP_SHA256_HPP

#include <array>
#include <cstddef>
#include <cstdint>

namespace flexcomp {

/// SHA-256 of bytes given one by one. Work: one compression per 64 bytes.
class Sha256 {
 public:
  /// Takes the next byte into account.
  // Not inlined: it is called from half a dozen places, each of which would bring its copy into flash.
  [[gnu::noinline]] void update(std::uint8_t byte) {
    block_[size_++ & 63U] = byte;
    if ((size_ & 63U) == 0) compress();
  }

  /// Digest of all bytes so far; the object must not be used afterwards.
  [[gnu::noinline]] std::array<std::uint8_t, 32> finish() {
    const std::uint64_t bits = size_ * 8U;
    update(0x80);
    while ((size_ & 63U) != 56U) update(0);
    for (unsigned k = 0; k < 8; ++k) update(static_cast<std::uint8_t>(bits >> (56U - 8U * k)));
    std::array<std::uint8_t, 32> digest{};
    for (std::size_t i = 0; i < 32; ++i) {
      digest[i] = static_cast<std::uint8_t>(state_[i / 4] >> (24U - 8U * (i % 4)));
    }
    return digest;
  }

 private:
  static std::uint32_t rotate_right(std::uint32_t v, unsigned n) { return (v >> n) | (v << (32U - n)); }

  void compress() {
    static const std::uint32_t k[64] = {
        0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
        0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
        0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
        0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
        0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
        0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
        0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
        0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};
    std::uint32_t w[64];
    for (unsigned i = 0; i < 16; ++i) {
      w[i] = (static_cast<std::uint32_t>(block_[4 * i]) << 24U) |
             (static_cast<std::uint32_t>(block_[4 * i + 1]) << 16U) |
             (static_cast<std::uint32_t>(block_[4 * i + 2]) << 8U) | block_[4 * i + 3];
    }
    for (unsigned i = 16; i < 64; ++i) {
      const std::uint32_t s0 = rotate_right(w[i - 15], 7) ^ rotate_right(w[i - 15], 18) ^ (w[i - 15] >> 3U);
      const std::uint32_t s1 = rotate_right(w[i - 2], 17) ^ rotate_right(w[i - 2], 19) ^ (w[i - 2] >> 10U);
      w[i] = w[i - 16] + s0 + w[i - 7] + s1;
    }
    std::array<std::uint32_t, 8> v = state_;
    for (unsigned i = 0; i < 64; ++i) {
      const std::uint32_t s1 = rotate_right(v[4], 6) ^ rotate_right(v[4], 11) ^ rotate_right(v[4], 25);
      const std::uint32_t t1 = v[7] + s1 + ((v[4] & v[5]) ^ (~v[4] & v[6])) + k[i] + w[i];
      const std::uint32_t s0 = rotate_right(v[0], 2) ^ rotate_right(v[0], 13) ^ rotate_right(v[0], 22);
      const std::uint32_t t2 = s0 + ((v[0] & v[1]) ^ (v[0] & v[2]) ^ (v[1] & v[2]));
      for (unsigned j = 7; j > 0; --j) v[j] = v[j - 1];
      v[4] += t1;
      v[0] = t1 + t2;
    }
    for (unsigned j = 0; j < 8; ++j) state_[j] += v[j];
  }

  std::array<std::uint32_t, 8> state_{
      {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a, 0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19}};
  std::array<std::uint8_t, 64> block_{};
  std::uint64_t size_ = 0;
};

/// SHA-256 of `size` bytes, or characters of a text.
template <class Byte>
inline std::array<std::uint8_t, 32> sha256(const Byte* bytes, std::size_t size) {
  Sha256 sha;
  for (std::size_t k = 0; k < size; ++k) sha.update(static_cast<std::uint8_t>(bytes[k]));
  return sha.finish();
}

}  // namespace flexcomp

#endif
