// SPDX-License-Identifier: Apache-2.0
/// \file
/// Normally distributed noise, and what it makes of a pose.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <random>

#include "flexcomp/linear.hpp"

namespace support {

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// Of standard deviation 1.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : random_(seed) {}
  double operator()() { return normal_(random_); }
  Eigen::Vector3d vector() { return {(*this)(), (*this)(), (*this)()}; }
  flexcomp::Pose<double> pose(double size_m = 1) {
    Eigen::Quaterniond q((*this)(), (*this)(), (*this)(), (*this)());
    return {q.normalized().toRotationMatrix(), size_m * vector()};
  }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

/// [position, m; rotation vector, rad] from the true pose to the one that was found.
inline Vector6d error_of(const flexcomp::Pose<double>& found, const flexcomp::Pose<double>& truth) {
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(found.rotation * truth.rotation.transpose()));
  Vector6d e;
  e << found.position - truth.position, turn.angle() * turn.axis();
  return e;
}

}  // namespace support
