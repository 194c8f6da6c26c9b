// SPDX-License-Identifier: Apache-2.0
/// \file
/// Bases of terms that need neither frames nor loads (docs/model.md, section 2): waves, splines (M6), grids
/// (M7).
#ifndef FLEXCOMP_DETAIL_BASIS_HPP
#define FLEXCOMP_DETAIL_BASIS_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/model.hpp"
#include "flexcomp/robot.hpp"
#include "flexcomp/term.hpp"
#include "flexcomp/trigonometry.hpp"

namespace flexcomp {
namespace detail {

/// Integer part towards zero; overloaded for dual numbers beside their type.
inline std::int32_t truncate(double v) { return static_cast<std::int32_t>(v); }
inline std::int32_t truncate(float v) { return static_cast<std::int32_t>(v); }
template <class T>
inline std::int32_t truncate(const T& v) {
  return static_cast<std::int32_t>(v.a);
}

/// The four weights of a uniform periodic cubic B-spline (M6) and the indices of their coefficients.
template <class S>
struct CurveWeights {
  std::array<S, 4> w;
  std::array<std::uint16_t, 4> index;
};

/// Weights of the curve (M6) with m coefficients at q, rad.
template <class S>
inline CurveWeights<S> curve_weights(const S& q, std::uint16_t m) {
  const S t = q * S(static_cast<float>(m)) * S(0.15915494309189533577);
  std::int32_t k = 0;
  // Readings lie within ±1e5 rad and M <= 256: far inside 32 bits. Written so that a NaN gives k = 0.
  if (t > S(-1e7F) && t < S(1e7F)) k = truncate(t);
  S u = t - S(static_cast<float>(k));
  if (u < S(0)) {
    u += S(1);
    --k;
  }
  CurveWeights<S> r;
  const S v = S(1) - u;
  r.w[0] = v * v * v * S(1.0 / 6);
  r.w[1] = S(2.0 / 3) - u * u * (S(1) - u * S(0.5));
  r.w[2] = S(2.0 / 3) - v * v * (S(1) - v * S(0.5));
  r.w[3] = u * u * u * S(1.0 / 6);
  std::int32_t first = (k - 1) % static_cast<std::int32_t>(m);
  if (first < 0) first += m;
  for (std::size_t i = 0; i < 4; ++i) {
    r.index[i] = static_cast<std::uint16_t>(first);
    if (++first == m) first = 0;
  }
  return r;
}

/// Second-order Taylor expansion of a function of a joint's reading: value, slope per rad and half the second
/// derivative.
template <class S>
struct Expansion {
  S value, slope, half_curvature;
};

/// Adds k times the spline (M6) at the reading q (rad): the cubic of its cell in powers of the distance to
/// the cell's start.
template <class S, std::size_t N, class Cap>
FLEXCOMP_ONCE void expand_curve(const Model<S, N, Cap>& model, const Term<S>& term, const S& q, const S& k,
                                Expansion<S>& sum) {
  const Table& table = model.table(term.table);
  const std::int32_t m = table.size;
  const S per_rad = S(static_cast<float>(table.size)) * S(0.15915494309189533577);
  const S t = q * per_rad;
  std::int32_t cell = 0;
  // As in curve_weights(): far inside 32 bits, and a NaN gives cell 0.
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

/// Value of a covariate of a grid (M7), in its unit.
template <class S, std::size_t N>
FLEXCOMP_ONCE S covariate(Covariate kind, std::size_t joint, const std::array<S, N>& q,
                          const Context<S, N>& context) {
  switch (kind) {
    case Covariate::joint_position:
      return q[joint];
    case Covariate::payload:
      return context.payload_kg;
    case Covariate::temperature:
      return context.temperature_c;
    case Covariate::time:
      return context.time_s;
    case Covariate::direction:
      return context.direction[joint];
    case Covariate::relative_speed:
      return context.relative_speed[joint];
  }
  return S(0);
}

/// Cell of a grid along one side, and the position in it, 0 … 1.
template <class S>
struct Cell {
  std::size_t index;
  S fraction;
};

/// Cell of x among ascending nodes, at most 64; constant outside them (M7).
template <class S>
FLEXCOMP_ONCE Cell<S> find_cell(const S* nodes, std::size_t count, const S& x) {
  if (!(x > nodes[0])) return {0, S(0)};
  std::size_t k = 0;
  for (std::size_t end = count - 1; end - k > 1;) {  // at most 64 nodes: six halvings
    const std::size_t middle = (k + end) / 2;
    if (x >= nodes[middle]) {
      k = middle;
    } else {
      end = middle;
    }
  }
  if (x >= nodes[k + 1]) return {k, S(1)};
  return {k, (x - nodes[k]) / (nodes[k + 1] - nodes[k])};
}

/// Bilinear interpolation of a grid (M7).
template <class S>
inline S bilinear(const S* v, std::size_t columns, const Cell<S>& row, const Cell<S>& column) {
  const S* top = v + row.index * columns + column.index;
  const S* bottom = top + columns;
  const S upper = top[0] + (top[1] - top[0]) * column.fraction;
  const S lower = bottom[0] + (bottom[1] - bottom[0]) * column.fraction;
  return upper + (lower - upper) * row.fraction;
}

/// Sine and cosine of order x reading, kept for the next term: harmonics come in pairs.
template <class S>
class Wave {
 public:
  /// Of the joint's reading q, rad: the same for all calls with that joint.
  const SinCos<S>& at(std::uint8_t joint, const S& order, const S& q) {
    if (joint != joint_ || order < order_ || order > order_) {
      joint_ = joint;
      order_ = order;
      value_ = sin_cos(order * q);
    }
    return value_;
  }

 private:
  std::uint8_t joint_ = 0xFF;
  S order_ = S(0);
  SinCos<S> value_{S(0), S(1)};
};

/// Basis (M5) of a term that needs neither frames nor loads, at the readings q (rad). A curve's factor of
/// torque is left to the caller.
template <class S, std::size_t N, class Cap>
inline S plain_basis_value(const Model<S, N, Cap>& model, const Term<S>& term, const Context<S, N>& context,
                           const std::array<S, N>& q, Wave<S>& wave) {
  const std::size_t j = term.joint;
  switch (term.basis) {
    case Basis::one:
      return S(1);
    case Basis::joint_position:
      return q[j];
    case Basis::sine:
      return wave.at(term.joint, term.argument, q[j]).s;
    case Basis::cosine:
      return wave.at(term.joint, term.argument, q[j]).c;
    case Basis::direction:
      return -context.direction[j];
    case Basis::relative_speed:
      return context.relative_speed[j];
    case Basis::thermal: {
      const LinkShape<S>& link = model.nominal(term.place.body - 1U);
      return (context.temperature_c - model.reference_temperature()) *
             (term.place.slot == slot::a ? link.a : link.d);
    }
    case Basis::time:
      return context.time_s;
    case Basis::curve: {
      Expansion<S> at = {S(0), S(0), S(0)};
      expand_curve(model, term, q[j], S(1), at);
      const S value = at.value;
      if (term.factor == Factor::temperature)
        return value * (context.temperature_c - model.reference_temperature());
      if (term.factor == Factor::payload) return value * context.payload_kg;
      return value;
    }
    case Basis::step:
      return context.time_s >= term.argument ? S(1) : S(0);
    case Basis::grid: {
      const Table& table = model.table(term.table);
      const S* nodes = model.values(table);
      const S row = covariate<S, N>(table.row_covariate, table.row_joint, q, context);
      const S column = covariate<S, N>(table.column_covariate, table.column_joint, q, context);
      return bilinear<S>(nodes + table.rows + table.columns, table.columns,
                         find_cell<S>(nodes, table.rows, row),
                         find_cell<S>(nodes + table.rows, table.columns, column));
    }
    default:
      return S(0);
  }
}

}  // namespace detail
}  // namespace flexcomp

#endif
