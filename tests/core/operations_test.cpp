// SPDX-License-Identifier: Apache-2.0
// The floor under the instruction budget: how many floating-point operations a step of compensation needs, counted by a
// scalar that counts. Moves, loads and the control cycle's own work are not in it.
#include <cmath>
#include <cstdint>
#include <cstdio>

#include <Eigen/Core>

#include <flexcomp/trigonometry.hpp>

namespace counting {

struct Count {
  std::uint64_t add = 0, multiply = 0, divide = 0, root = 0, compare = 0;
  std::uint64_t arithmetic() const { return add + multiply + divide + root; }
};
inline Count& count() {
  static Count c;
  return c;
}

/// A double that counts what is done with it.
struct Real {
  double v = 0;
  constexpr Real() = default;
  constexpr explicit Real(double x) : v(x) {}
  constexpr explicit Real(float x) : v(static_cast<double>(x)) {}
  constexpr explicit Real(int x) : v(x) {}
  explicit operator float() const { return static_cast<float>(v); }
  explicit operator double() const { return v; }
  Real& operator+=(Real b) { return ++count().add, v += b.v, *this; }
  Real& operator-=(Real b) { return ++count().add, v -= b.v, *this; }
  Real& operator*=(Real b) { return ++count().multiply, v *= b.v, *this; }
  Real& operator/=(Real b) { return ++count().divide, v /= b.v, *this; }
  Real operator-() const { return Real(-v); }
};
inline Real operator+(Real a, Real b) { return a += b; }
inline Real operator-(Real a, Real b) { return a -= b; }
inline Real operator*(Real a, Real b) { return a *= b; }
inline Real operator/(Real a, Real b) { return a /= b; }
inline bool operator<(Real a, Real b) { return ++count().compare, a.v < b.v; }
inline bool operator>(Real a, Real b) { return ++count().compare, a.v > b.v; }
inline bool operator<=(Real a, Real b) { return ++count().compare, a.v <= b.v; }
inline bool operator>=(Real a, Real b) { return ++count().compare, a.v >= b.v; }
inline bool operator==(Real a, Real b) { return ++count().compare, a.v == b.v; }
inline bool operator!=(Real a, Real b) { return !(a == b); }
inline Real sqrt(Real a) { return ++count().root, Real(std::sqrt(a.v)); }
/// The kernel of double has 3 operations of reduction, 6 + 6 terms of the polynomials and what joins them.
inline void sin_cos_kernel(Real x, Real& s, Real& c) {
  count().multiply += 20;
  count().add += 17;
  const flexcomp::SinCos<double> r = flexcomp::sin_cos(x.v);
  s = Real(r.s);
  c = Real(r.c);
}
inline Real sin(Real x) {
  Real s, c;
  sin_cos_kernel(x, s, c);
  return s;
}
inline Real cos(Real x) {
  return Real(flexcomp::sin_cos(x.v).c);  // counted by the sine beside it
}
inline std::int32_t truncate(Real a) { return static_cast<std::int32_t>(a.v); }

}  // namespace counting

namespace Eigen {
template <>
struct NumTraits<counting::Real> : GenericNumTraits<counting::Real> {
  using Real = counting::Real;
  using NonInteger = counting::Real;
  using Literal = counting::Real;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = 1,
    AddCost = 1,
    MulCost = 1
  };
};
}  // namespace Eigen

#include <flexcomp/compensate.hpp>

#include <gtest/gtest.h>

#include "support/arms.hpp"

namespace {

using counting::Real;

TEST(Operations, OfACompensation) {
  const arms::Robot robot = arms::tx60l();
  const arms::TermSet<double> exact = arms::table1(arms::all()[0]);
  const auto reference = arms::prepared(robot, exact);
  const auto model = arms::prepared(robot, arms::as<Real>(exact));
  const flexcomp::Context<double, 6> context = flexcomp::default_context<double>(robot);
  const flexcomp::Context<Real, 6> counted = arms::as<Real>(context);
  arms::Random random(1);
  std::uint64_t least = ~std::uint64_t{0}, most = 0, sum = 0, compares = 0;
  constexpr int poses = 200;
  for (int n = 0; n < poses; ++n) {
    const arms::Joints q = random.pose(robot);
    const std::array<Real, 6> command = arms::as<Real>(q);
    counting::count() = {};
    const flexcomp::Compensated<Real, 6> r = flexcomp::compensate(model, command, counted);
    const counting::Count c = counting::count();
    // The counting scalar must take the same branches as double.
    const flexcomp::Compensated<double, 6> d = flexcomp::compensate(reference, q, context);
    ASSERT_EQ(r.status, d.status);
    for (std::size_t i = 0; i < 6; ++i) ASSERT_EQ(r.q[i].v, d.q[i]);
    least = std::min(least, c.arithmetic());
    most = std::max(most, c.arithmetic());
    sum += c.arithmetic();
    compares += c.compare;
  }
  std::printf(
      "[ measured ] operations of a compensation with 39 terms: least %u, mean %u, most %u; compares %u\n",
      static_cast<unsigned>(least), static_cast<unsigned>(sum / poses), static_cast<unsigned>(most),
      static_cast<unsigned>(compares / poses));
  EXPECT_GT(least, 2000U);  // three passes and two solutions cannot be had for less
  EXPECT_LT(sum / poses, 5000U);
}

}  // namespace
