// SPDX-License-Identifier: Apache-2.0
/// \file
/// Measurement noise of the paper's simulations.
#ifndef FLEXCOMP_HOST_MEASUREMENT_NOISE_LEVEL_HPP
#define FLEXCOMP_HOST_MEASUREMENT_NOISE_LEVEL_HPP

#include "units.hpp"

namespace flexcomp::host {

/// Standard deviations per axis: of the position, or of each reflector point, and of the rotation vector.
struct NoiseLevel {
  const char* name;
  double position_sigma_m;
  double orientation_sigma_rad;
};

/// Chen et al. 2019, Section 3.1 and 4.
constexpr NoiseLevel noise_n1{"N1", 0.035e-3, radians(0.007)};
constexpr NoiseLevel noise_n2{"N2", 0.07e-3, radians(0.014)};
constexpr NoiseLevel no_noise{"none", 0, 0};

}  // namespace flexcomp::host

#endif
