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

/// Second-order Taylor expansion of a function of a joint's reading: value, slope per rad and half the second
/// derivative.
template <class S>
struct Expansion {
  S value, slope, half_curvature;
};

/// Adds k times the spline (M6) at the reading q (rad): the cubic of its cell in powers of the distance to
/// the cell's start.
template <class S, std::size_t N, class Cap>
inline void expand_curve(const Model<S, N, Cap>& model, const Term<S>& term, const S& q, const S& k,
                         Expansion<S>& sum) {
  const Table& table = model.table(term.table);
  const std::int32_t m = table.size;
  const S per_rad = S(static_cast<float>(table.size)) * S(0.15915494309189533577);
  const S t = q * per_rad;
  std::int32_t cell = 0;
  // As in curve_weights(): distal inside 32 bits, and a NaN gives cell 0.
  if (t * t < S(1e14F)) cell = truncate(t);
  S u = t - S(static_cast<float>(cell));
  if (u < S(0)) {
    u += S(1);
    --cell;
  }
  std::int32_t first = (cell - 1) % m;
  if (first < 0) first += m;
  const S* from = model.values(table) + first;
  S c0 = from[0], c1, c2, c3;
  if (first + 3 < m) {
    c1 = from[1];
    c2 = from[2];
    c3 = from[3];
  } else {
    c1 = from[first + 1 < m ? 1 : 1 - m];
    c2 = from[first + 2 < m ? 2 : 2 - m];
    c3 = from[3 - m];
  }
  // p0 + p1 u + p2 u^2 + p3 u^3
  S p3 = (c1 - c2) * S(0.5);
  p3 += (c3 - c0) * S(1.0 / 6);
  S p2 = (c0 + c2) * S(0.5);
  p2 -= c1;
  const S p1 = (c2 - c0) * S(0.5);
  S p0 = p2 * S(1.0 / 3);
  p0 += c1;
  const S bend = u * p3;
  const S half = p2 + bend + bend + bend;  // of the second derivative
  const S value = p1 + u * (p2 + bend);
  sum.value += k * (p0 + u * value);
  const S scale = k * per_rad;
  sum.slope += scale * (p1 + u * (p2 + half));
  sum.half_curvature += scale * per_rad * half;
}

/// Adds the expansion of a term of Model::own_term() at the reading q (rad).
template <class S, std::size_t N, class Cap>
inline void add_own_deflection(const Model<S, N, Cap>& model, const Term<S>& term, const S& q,
                               const Context<S, N>& context, Expansion<S>& sum) {
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
    const SinCos<S> wave = sin_cos(order * q);
    const bool is_sine = term.basis == Basis::sine;
    const S f = k * (is_sine ? wave.s : wave.c);
    sum.value += f;
    sum.slope += k * order * (is_sine ? wave.c : -wave.s);
    sum.half_curvature -= S(0.5) * order * order * f;
  }
}

/// Adds the terms of Model::other_term() at the readings q: deflections that need no frames, rad.
template <class S, std::size_t N, class Cap>
inline void add_other_deflections(const Model<S, N, Cap>& model, const std::array<S, N>& q,
                                  const Context<S, N>& context, std::array<S, N>& deflection) {
  for (std::size_t k = 0; k < model.other_count(); ++k) {
    const Term<S>& term = model.other_term(k);
    deflection[term.place.body - 1U] += term.coefficient * plain_basis_value(model, term, context, q);
  }
}

/// Solves x + own(x) = q for the readings x by one step of Newton's method with the curvature (C14), in
/// place. `share` becomes w = 1 / (1 + own').
template <class S, std::size_t N, class Cap>
inline void subtract_own_deflections(const Model<S, N, Cap>& model, const Context<S, N>& context,
                                     std::array<S, N>& q, std::array<S, N>& dq, std::array<S, N>& share) {
  std::array<Expansion<S>, N> own;
  for (Expansion<S>& o : own) o.value = o.slope = o.half_curvature = S(0);
  for (std::size_t k = 0; k < model.own_count(); ++k) {
    const Term<S>& term = model.own_term(k);
    add_own_deflection(model, term, q[term.joint], context, own[term.joint]);
  }
  for (std::size_t i = 0; i < N; ++i) {
    const S w = S(1) / (S(1) + own[i].slope);
    const S newton = own[i].value * w;
    const S step = newton + own[i].half_curvature * newton * newton * w;
    share[i] = w;
    q[i] -= step;
    dq[i] -= step;
  }
}

}  // namespace detail
}  // namespace flexcomp

#endif
