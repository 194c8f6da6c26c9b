// SPDX-License-Identifier: Apache-2.0
/// \file
/// Settings and bounds of a corrected command: finiteness, largest correction, joint limits
/// (docs/compensation.md, C10, C17, C20). The core and the control cycle share them.
#ifndef FLEXCOMP_BOUNDS_HPP
#define FLEXCOMP_BOUNDS_HPP

#include <array>
#include <cstddef>

#include "flexcomp/detail/compiler.hpp"

namespace flexcomp {

/// Settings of the compensation (docs/compensation.md, section 1). The defaults suit arms of 0.3 to 4 m with
/// errors below 20 mm.
template <class S>
struct CompensationSettings {
  S largest_correction_rad = S(0.1);  ///< of any joint; a larger correction is scaled as a whole (C10, C17)
  /// Greatest slope of the correction over the command near singularities (C9), 2-norms: a larger one leaves less error there.
  S steepest = S(100);
};

/// Sum of 0·x over numbers: 0 where all are finite, else NaN. Two operations per number, no branch.
template <class S>
class FiniteCheck {
 public:
  /// Takes one number into account.
  void add(const S& x) { sum_ += S(0) * x; }
  /// Takes every number of a list into account.
  template <std::size_t N>
  void add(const std::array<S, N>& v) {
    FLEXCOMP_UNROLL
    for (std::size_t i = 0; i < N; ++i) add(v[i]);
  }
  /// True where all numbers so far are finite.
  bool passed() const { return sum_ <= S(0); }

 private:
  S sum_ = S(0);
};

/// Largest magnitude in a list, the maximum norm; NaNs are skipped.
template <class S, std::size_t N>
FLEXCOMP_ONCE S greatest_of(const std::array<S, N>& v) {
  S greatest = S(0);
  for (const S x : v) {
    if (x > greatest) greatest = x;
    if (-x > greatest) greatest = -x;
  }
  return greatest;
}

/// Sum of squares of a list, the squared 2-norm.
template <class S, std::size_t N>
inline S square_of(const std::array<S, N>& v) {
  S sum = S(0);
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) sum += v[i] * v[i];
  return sum;
}

/// Scales a correction as a whole so that no joint exceeds `largest` (C10, C17); true where that was needed.
template <class S, std::size_t N>
FLEXCOMP_ONCE bool scale_to_limit(std::array<S, N>& v, S largest) {
  const S greatest = greatest_of(v);
  if (!(greatest > largest)) return false;
  const S scale = largest / greatest;
  for (S& x : v) x *= scale;
  return true;
}

/// Moves a value to the nearer end of an interval it lies outside of (C17, C20); true where that was needed.
template <class S>
inline bool clamp_to(S& x, const S& low, const S& high) {
  if (x < low) {
    x = low;
    return true;
  }
  if (x > high) {
    x = high;
    return true;
  }
  return false;
}

}  // namespace flexcomp

#endif
