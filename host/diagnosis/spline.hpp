// SPDX-License-Identifier: Apache-2.0
/// \file
/// Cardinal cubic B-spline of an angle (docs/model.md, M6).
#pragma once

#include <cmath>

#include "units.hpp"

namespace flexcomp::host {

/// B(x): cubic B-spline of unit knot spacing, centred at 0; zero for |x| >= 2 (de Boor).
inline double cardinal_spline(double x) {
  x = std::abs(x);
  if (x < 1) return 2.0 / 3 - x * x + x * x * x / 2;
  return x < 2 ? std::pow(2 - x, 3) / 6 : 0;
}

/// a - b, folded to -pi ... pi.
inline double angle_difference(double a, double b) { return std::remainder(a - b, 2 * pi); }

}  // namespace flexcomp::host
