// SPDX-License-Identifier: Apache-2.0
/// \file
/// Joint deflections that depend on readings and context alone (docs/compensation.md, C11 and C14): curves,
/// sines, scale, directions, grids.
#ifndef FLEXCOMP_DETAIL_OWN_DEFLECTION_HPP
#define FLEXCOMP_DETAIL_OWN_DEFLECTION_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/detail/basis.hpp"

namespace flexcomp {
namespace detail {

/// Adds the expansion of a term of group::own at the reading q (rad).
template <class S, std::size_t N, class Cap>
inline void add_own_deflection(const Model<S, N, Cap>& model, const Term<S>& term, const S& q,
                               const Context<S, N>& context, Wave<S>& waves, Expansion<S>& sum) {
  S k = term.coefficient;
  if (term.basis == Basis::curve) {
    if (term.factor == Factor::temperature) k *= context.temperature_c - model.reference_temperature();
    if (term.factor == Factor::payload) k *= context.payload_kg;
    expand_curve(model, term, q, k, sum);
  } else if (term.basis == Basis::joint_position) {
    sum.value += k * q;
    sum.slope += k;
  } else {
    const S order = term.argument;
    const SinCos<S>& wave = waves.at(term.joint, order, q);
    const bool is_sine = term.basis == Basis::sine;
    const S f = k * (is_sine ? wave.s : wave.c);
    sum.value += f;
    sum.slope += k * order * (is_sine ? wave.c : -wave.s);
    sum.half_curvature -= S(0.5) * order * order * f;
  }
}

/// Expansions of the own deflections of all joints at the readings q (rad).
template <class S, std::size_t N, class Cap>
FLEXCOMP_ONCE void own_deflections(const Model<S, N, Cap>& model, const Context<S, N>& context,
                                   const std::array<S, N>& q, std::array<Expansion<S>, N>& own) {
  for (Expansion<S>& o : own) o.value = o.slope = o.half_curvature = S(0);
  Wave<S> wave;
  const std::size_t count = model.plan().size(group::own);
  for (std::size_t k = 0; k < count; ++k) {
    const Term<S>& term = model.effect_of(group::own, k);
    add_own_deflection(model, term, q[term.joint], context, wave, own[term.joint]);
  }
}

/// Most evaluations of a joint's own deflections.
constexpr int most_own_steps = 4;

/// Solves x + own(x) = q for the readings x by Newton's method with the curvature (C14), in place; `ahead` takes the same
/// change. `share` becomes w = 1 / (1 + own'). False where it does not end: the curvature's part of the step, of which what
/// it leaves is a fraction, or a hundred times the bound of what the third derivative leaves, stays above `tolerance` (rad).
template <class S, std::size_t N, class Cap>
FLEXCOMP_ONCE bool subtract_own_deflections(const Model<S, N, Cap>& model, const Context<S, N>& context,
                                            const S& tolerance, std::array<S, N>& q, std::array<S, N>& ahead,
                                            std::array<S, N>& share) {
  const std::array<S, N> target = q;
  for (int n = 0; n < most_own_steps; ++n) {
    std::array<Expansion<S>, N> own;
    own_deflections(model, context, q, own);
    S largest = S(0);
    for (std::size_t i = 0; i < N; ++i) {
      const S w = S(1) / (S(1) + own[i].slope);
      const S newton = (q[i] + own[i].value - target[i]) * w;
      const S bend = own[i].half_curvature * newton * newton * w;
      share[i] = w;
      q[i] -= newton + bend;
      ahead[i] -= newton + bend;
      if (bend * bend > largest) largest = bend * bend;
      // Where the curvature vanishes the third derivative decides.
      const S square = newton * newton;
      const S left = model.plan().third_square(i) * square * square * square;
      if (left > largest) largest = left;
    }
    if (largest <= tolerance * tolerance) return true;
  }
  return false;
}

}  // namespace detail
}  // namespace flexcomp

#endif
