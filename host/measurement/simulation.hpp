// SPDX-License-Identifier: Apache-2.0
/// \file
/// Measured data from an assumed true robot: random poses and contexts, and an instrument with normal noise.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "measurement/measured_data.hpp"
#include "model/calibration.hpp"
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

struct Simulation {
  MeasurementKind kind = MeasurementKind::pose;
  NoiseLevel noise = no_noise;
  std::size_t poses = 0;            ///< random ones, uniform within the joint limits
  std::vector<double> payloads_kg;  ///< in turn; default: the robot file's
  bool context = false;             ///< also random motion before each pose, temperature and time
  std::uint64_t seed = 1;
};

/// \param truth   the robot's errors, and the frames of the measurement
/// \param joints  poses with their contexts instead of random ones
/// \throws InputError  no_reflectors
MeasuredData simulate(const Robot& robot, const Calibration& truth, const Simulation& simulation,
                      const std::optional<MeasuredData>& joints = {});

}  // namespace flexcomp::host
