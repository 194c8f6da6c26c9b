// SPDX-License-Identifier: Apache-2.0
/// \file
/// Sine and cosine with the same bits on every target (docs/model.md, M16).
///
/// C libraries differ by up to 16 ulp between x86-64, newlib on Cortex-M and on Cortex-R. Built with
/// -ffp-contract=off these kernels give the same bits wherever IEEE 754 arithmetic is correctly rounded.
#ifndef FLEXCOMP_TRIGONOMETRY_HPP
#define FLEXCOMP_TRIGONOMETRY_HPP

#include <cstdint>
#include <limits>

#include "flexcomp/detail/compiler.hpp"

namespace flexcomp {

/// Ratio of circumference to diameter.
constexpr double pi = 3.14159265358979323846;

/// The largest angle of sin_cos(), rad: what its range reduction is exact for.
template <class S>
struct LargestAngle {
  /// In double and dual numbers.
  static S value() { return S(1e5); }
};
/// The largest angle of sin_cos() in single precision, rad.
template <>
struct LargestAngle<float> {
  /// In single precision.
  static constexpr float value() { return 1e4F; }
};

/// Sine and cosine of one angle (dimensionless).
template <class S>
struct SinCos {
  S s;  ///< sine
  S c;  ///< cosine
};

namespace detail {

/// Nearest integer of t, |t| < 2^30; ties away from zero. No libm call, no rounding mode.
template <class S>
inline std::int32_t nearest(S t) {
  return static_cast<std::int32_t>(t < S(0) ? t - S(0.5) : t + S(0.5));
}

/// Rotates (s, c) of the reduced angle by n quarter turns.
template <class S>
inline void quadrant(std::int32_t n, S s, S c, S& sine, S& cosine) {
  const std::uint32_t turns = static_cast<std::uint32_t>(n);
  if ((turns & 1U) != 0) {
    const S t = s;
    s = c;
    c = -t;
  }
  if ((turns & 2U) != 0) {
    s = -s;
    c = -c;
  }
  sine = s;
  cosine = c;
}

/// sin_cos() for |x| <= 1e5.
inline void sin_cos_kernel(double x, double& sine, double& cosine) {
  const std::int32_t n = nearest(x * 6.36619772367581382433e-01);
  const double k = static_cast<double>(n);
  // The head has 33 bits, so k * head is exact for |k| < 2^20; the tail carries the next 53 bits.
  const double r = (x - k * 1.57079632673412561417e+00) - k * 6.07710050650619224932e-11;
  const double z = r * r;
  const double s =
      r + r * z *
              (-1.66666666666666324348e-01 +
               z * (8.33333333332248946124e-03 +
                    z * (-1.98412698298579493134e-04 +
                         z * (2.75573137070700676789e-06 +
                              z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
  const double c =
      1.0 -
      (0.5 * z - z * z *
                     (4.16666666666666019037e-02 +
                      z * (-1.38888888888741095749e-03 +
                           z * (2.48015872894767294178e-05 +
                                z * (-2.75573143513906633035e-07 +
                                     z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))))));
  quadrant(n, s, c, sine, cosine);
}

/// sin_cos() for |x| <= 1e4.
inline void sin_cos_kernel(float x, float& sine, float& cosine) {
  const std::int32_t n = nearest(x * 6.3661977e-01F);
  const float k = static_cast<float>(n);
  const float r = ((x - k * 1.5703125F) - k * 4.837512969970703125e-4F) - k * 7.54978995489188216e-8F;
  const float z = r * r;
  const float s = r + r * z * (-1.6666654611e-1F + z * (8.3321608736e-3F + z * -1.9515295891e-4F));
  const float c =
      1.0F -
      (0.5F * z - z * z * (4.166664568298827e-2F + z * (-1.388731625493765e-3F + z * 2.443315711809948e-5F)));
  quadrant(n, s, c, sine, cosine);
}

}  // namespace detail

/// Sine and cosine of x (rad); error below 0.7 ulp of 1 for |x| <= 1e5, NaN beyond or for a NaN.
/// Range reduction after Cody and Waite with a 33-bit head, polynomials of fdlibm (k_sin.c, k_cos.c).
FLEXCOMP_ONCE inline SinCos<double> sin_cos(double x) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  SinCos<double> r{nan, nan};
  if (x <= 1e5 && x >= -1e5) detail::sin_cos_kernel(x, r.s, r.c);
  return r;
}

/// Sine and cosine of x (rad); error below 0.7 ulp of 1 for |x| <= 1e4, NaN beyond or for a NaN.
/// Three-part reduction and polynomials after Cephes (sinf.c); no double arithmetic, for single-precision
/// FPUs.
FLEXCOMP_ONCE inline SinCos<float> sin_cos(float x) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  SinCos<float> r{nan, nan};
  if (x <= 1e4F && x >= -1e4F) detail::sin_cos_kernel(x, r.s, r.c);
  return r;
}

/// Sine and cosine of any other scalar (dual numbers) by the functions found beside its type.
template <class S>
inline SinCos<S> sin_cos(const S& x) {
  return {sin(x), cos(x)};
}

/// Sine and cosine of a sum of two angles (addition theorem).
template <class S>
inline SinCos<S> compose(const SinCos<S>& a, const SinCos<S>& b) {
  return {a.s * b.c + a.c * b.s, a.c * b.c - a.s * b.s};
}

/// Sine and cosine of (angle + delta), delta in rad.
/// Below 1/64 rad a series replaces the kernel (next term 9e-20), and only the small difference is added, so
/// that a correction of micro-radians loses nothing to rounding; above it the kernel is used.
template <class S>
FLEXCOMP_ONCE SinCos<S> rotate(const SinCos<S>& t, const S& delta) {
  if (delta < S(0.015625) && delta > S(-0.015625)) {
    const S z = delta * delta;
    const S sd = delta - delta * z * (S(1.0 / 6) - z * (S(1.0 / 120) - z * S(1.0 / 5040)));
    const S vd = z * (S(0.5) - z * (S(1.0 / 24) - z * S(1.0 / 720)));
    return {t.s + (t.c * sd - t.s * vd), t.c - (t.s * sd + t.c * vd)};
  }
  return compose(t, sin_cos(delta));
}

}  // namespace flexcomp

#endif
