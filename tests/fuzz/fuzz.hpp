// SPDX-License-Identifier: Apache-2.0
/// \file
/// What every fuzz target is made of: its name, what it does with an input, inputs to begin with, and how one input becomes
/// another. The same source is a libFuzzer program (libfuzzer.cpp) and a part of a test that replays inputs (replay.cpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

/// libFuzzer's own mutation, of at most `capacity` bytes; replay.cpp has one of its own.
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t capacity);

namespace fuzz {

using Bytes = std::vector<std::uint8_t>;

inline Bytes bytes_of(std::string_view text) { return {text.begin(), text.end()}; }
/// The lowest eight bits of each number.
template <class... Numbers>
Bytes octets(Numbers... numbers) {
  return {static_cast<std::uint8_t>(numbers)...};
}

/// A finding: says what does not hold and ends the program, as a sanitizer does.
[[noreturn]] inline void finding(const std::string& what) {
  std::fprintf(stderr, "FINDING: %s\n", what.c_str());
  std::abort();
}
inline void require(bool holds, const char* what) {
  if (!holds) finding(what);
}

/// Reads an input from its beginning; beyond its end everything is 0.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : at_(data), left_(size) {}
  explicit Input(const Bytes& bytes) : Input(bytes.data(), bytes.size()) {}

  bool is_empty() const { return left_ == 0; }
  std::uint8_t u8() {
    if (left_ == 0) return 0;
    --left_;
    return *at_++;
  }
  std::uint16_t u16() {
    const unsigned low = u8();
    return static_cast<std::uint16_t>(low | static_cast<unsigned>(u8()) << 8U);
  }
  std::uint32_t u32() {
    const std::uint32_t low = u16();
    return low | static_cast<std::uint32_t>(u16()) << 16U;
  }
  std::uint64_t u64() {
    const std::uint64_t low = u32();
    return low | static_cast<std::uint64_t>(u32()) << 32U;
  }
  /// Up to so many bytes.
  Bytes bytes(std::size_t count) {
    const std::size_t size = count < left_ ? count : left_;
    Bytes out(at_, at_ + size);
    at_ += size;
    left_ -= size;
    return out;
  }
  Bytes rest() { return bytes(left_); }
  std::string text() {
    const Bytes all = rest();
    return {all.begin(), all.end()};
  }

  /// A number as nobody would give it, or an ordinary one about 0.
  double odd_number() {
    using Limits = std::numeric_limits<double>;
    const unsigned kind = u8();
    switch (kind) {
      case 0:
        return 0;
      case 1:
        return -0.0;
      case 2:
        return Limits::quiet_NaN();
      case 3:
        return Limits::infinity();
      case 4:
        return -Limits::infinity();
      case 5:
        return Limits::max();
      case 6:
        return -Limits::max();
      case 7:
        return Limits::denorm_min();
      case 8:
        return 1e5;
      case 9:
        return -1e5;
      case 10:
        return 1.5707963267948966;
      case 11:
        return 2.2;
      case 12:
        return 1e30;
      case 13: {
        const std::uint64_t bits = u64();
        double v = 0;
        std::memcpy(&v, &bits, sizeof v);
        return v;
      }
      case 14:
        return static_cast<double>(u32()) * 1e-4;
      default:
        return (static_cast<double>(kind) - 135) * 0.02;
    }
  }

 private:
  const std::uint8_t* at_;
  std::size_t left_;
};

/// Appends what Input reads.
class Output {
 public:
  Output& u8(unsigned v) {
    out.push_back(static_cast<std::uint8_t>(v));
    return *this;
  }
  Output& u16(unsigned v) { return u8(v & 0xFFU).u8(v >> 8U & 0xFFU); }
  Output& u32(std::uint32_t v) { return u16(v & 0xFFFFU).u16(v >> 16U); }
  Output& add(const Bytes& bytes) {
    out.insert(out.end(), bytes.begin(), bytes.end());
    return *this;
  }
  Bytes out;
};

/// Numbers of a seed (xorshift64*): the same on every machine.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15U + 1) {}
  std::uint32_t operator()() {
    state_ ^= state_ >> 12U;
    state_ ^= state_ << 25U;
    state_ ^= state_ >> 27U;
    return static_cast<std::uint32_t>(state_ * 0x2545F4914F6CDD1DU >> 32U);
  }
  std::uint32_t below(std::size_t end) { return end == 0 ? 0 : static_cast<std::uint32_t>((*this)() % end); }

 private:
  std::uint64_t state_;
};

/// Random bytes, or a fragment that the format knows, put in, in place of something, or taken out.
inline std::size_t mutate_with(const char* const* words, std::size_t count, std::uint8_t* data,
                               std::size_t size, std::size_t capacity, unsigned seed) {
  Random random(seed);
  if (random.below(3) != 0) return LLVMFuzzerMutate(data, size, capacity);
  const std::string_view word = words[random.below(count)];
  const std::size_t at = random.below(size + 1);
  const std::size_t over = random.below(2) == 0 ? 0 : std::min<std::size_t>(random.below(12), size - at);
  if (size - over + word.size() > capacity) return LLVMFuzzerMutate(data, size, capacity);
  std::memmove(data + at + word.size(), data + at + over, size - at - over);
  std::memcpy(data + at, word.data(), word.size());
  return size - over + word.size();
}

/// One fuzz target.
struct Target {
  const char* name;
  void (*run)(Input input);
  std::vector<Bytes> (*seeds)();
  /// As LLVMFuzzerCustomMutator(); null: libFuzzer's.
  std::size_t (*mutate)(std::uint8_t* data, std::size_t size, std::size_t capacity, unsigned seed);
};

/// All targets of this program.
inline std::vector<Target>& targets() {
  static std::vector<Target> all;
  return all;
}

/// A static object of this type makes a target known.
struct Register {
  explicit Register(const Target& target) { targets().push_back(target); }
};

}  // namespace fuzz
