// SPDX-License-Identifier: Apache-2.0
/// \file
/// Little-endian integers, and conversion between binary64 and the target's scalar without double arithmetic
/// in software.
#ifndef FLEXCOMP_BYTES_HPP
#define FLEXCOMP_BYTES_HPP

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace flexcomp {

/// Bits of a binary64.
inline std::uint64_t bits_of(double v) {
  std::uint64_t b;
  std::memcpy(&b, &v, sizeof b);
  return b;
}

/// Binary64 of these bits.
inline double double_of(std::uint64_t b) {
  double v;
  std::memcpy(&v, &b, sizeof v);
  return v;
}

/// Bits of a float.
inline std::uint32_t bits32_of(float v) {
  std::uint32_t b;
  std::memcpy(&b, &v, sizeof b);
  return b;
}

/// A float from its bits.
inline float float_of(std::uint32_t b) {
  float v;
  std::memcpy(&v, &b, sizeof v);
  return v;
}

namespace detail {

/// binary64 bits to the nearest float (ties to even), in integer arithmetic: an M4F has no double unit, and
/// the link forbids its soft-float routines. Results below the normal range become zero, above it infinity.
/// Never inlined, like its opposite: a controller without doubles needs it for every number of its robot.
[[gnu::noinline]] inline float float_from_bits(std::uint64_t b) {
  const std::uint32_t sign = static_cast<std::uint32_t>(b >> 32U) & 0x80000000U;
  const std::int32_t exponent = static_cast<std::int32_t>((b >> 52U) & 0x7FFU) - 1023;
  const std::uint64_t fraction = b & 0xFFFFFFFFFFFFFULL;
  std::uint32_t out;
  if (exponent == 1024) {
    out = 0x7F800000U | (fraction != 0 ? 0x400000U : 0U);
  } else if (exponent > 127) {
    out = 0x7F800000U;
  } else if (exponent < -126) {
    out = 0;
  } else {
    out = (static_cast<std::uint32_t>(exponent + 127) << 23U) | static_cast<std::uint32_t>(fraction >> 29U);
    const std::uint32_t rest = static_cast<std::uint32_t>(fraction) & 0x1FFFFFFFU;
    // A carry out of the fraction moves into the exponent, which is the right result.
    if (rest > 0x10000000U || (rest == 0x10000000U && (out & 1U) != 0)) ++out;
  }
  out |= sign;
  return float_of(out);
}

/// float to the same value as binary64 bits, in integer arithmetic (subnormal floats become zero).
[[gnu::noinline]] inline std::uint64_t bits_from_float(float v) {
  const std::uint32_t b = bits32_of(v);
  const std::uint64_t sign = static_cast<std::uint64_t>(b & 0x80000000U) << 32U;
  const std::uint32_t exponent = (b >> 23U) & 0xFFU;
  const std::uint64_t fraction = static_cast<std::uint64_t>(b & 0x7FFFFFU) << 29U;
  if (exponent == 0) return sign;
  if (exponent == 0xFFU) return sign | 0x7FF0000000000000ULL | fraction;
  return sign | (static_cast<std::uint64_t>(exponent + 896U) << 52U) | fraction;
}

}  // namespace detail

/// The target's scalar nearest to a binary64 value.
template <class S>
inline S from_binary64(double v) {
  if constexpr (std::is_same<S, float>::value) {
    return detail::float_from_bits(bits_of(v));
  } else {
    return S(v);
  }
}

/// The bits of a scalar's value as binary64 (S: float or double).
template <class S>
inline std::uint64_t to_binary64_bits(S v) {
  if constexpr (std::is_same<S, float>::value) {
    return detail::bits_from_float(v);
  } else {
    return bits_of(v);
  }
}

/// Unsigned integer of 16 bits from little-endian bytes.
inline std::uint16_t load_u16(const std::uint8_t* p) {
  return static_cast<std::uint16_t>(p[0] | (static_cast<unsigned>(p[1]) << 8U));
}

/// Unsigned integer of 32 bits from little-endian bytes.
inline std::uint32_t load_u32(const std::uint8_t* p) {
  return p[0] | (static_cast<std::uint32_t>(p[1]) << 8U) | (static_cast<std::uint32_t>(p[2]) << 16U) |
         (static_cast<std::uint32_t>(p[3]) << 24U);
}

/// Unsigned integer of 64 bits from little-endian bytes.
inline std::uint64_t load_u64(const std::uint8_t* p) {
  return load_u32(p) | (static_cast<std::uint64_t>(load_u32(p + 4)) << 32U);
}

/// Writes an unsigned integer of 16 bits as little-endian bytes.
inline void store_u16(std::uint8_t* p, std::uint16_t v) {
  p[0] = static_cast<std::uint8_t>(v);
  p[1] = static_cast<std::uint8_t>(v >> 8U);
}

/// Writes an unsigned integer of 32 bits as little-endian bytes.
inline void store_u32(std::uint8_t* p, std::uint32_t v) {
  for (unsigned k = 0; k < 4; ++k) p[k] = static_cast<std::uint8_t>(v >> (8U * k));
}

/// Writes an unsigned integer of 64 bits as little-endian bytes.
inline void store_u64(std::uint8_t* p, std::uint64_t v) {
  for (unsigned k = 0; k < 8; ++k) p[k] = static_cast<std::uint8_t>(v >> (8U * k));
}

/// A binary64 in little-endian bytes as the target's scalar.
template <class S>
inline S load_scalar(const std::uint8_t* p) {
  const std::uint64_t b = load_u64(p);
  if constexpr (std::is_same<S, float>::value) {
    return detail::float_from_bits(b);
  } else {
    return double_of(b);
  }
}

/// True for a value that is neither infinite nor NaN; by its bits, so that -ffast-math cannot remove it.
inline bool is_finite(double v) { return (bits_of(v) & 0x7FF0000000000000ULL) != 0x7FF0000000000000ULL; }
/// is_finite() of a binary32.
inline bool is_finite(float v) {
  const std::uint32_t b = bits32_of(v);
  return (b & 0x7F800000U) != 0x7F800000U;
}

}  // namespace flexcomp

#endif
