// SPDX-License-Identifier: Apache-2.0
/// \file
/// Pose of a tracker in the constructed base frame Fb, from points with nominal positions.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "flexcomp/linear.hpp"

namespace flexcomp::host {

/// Result of fit_frame().
struct FrameFit {
  Pose<double> pose;  ///< maps the tracker's frame to Fb
  /// Covariance of [position, m; rotation vector log(R R_trueᵀ), rad], both in Fb, inverse of (M25). Far from
  /// the points the position is uncertain and correlated with the rotation.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  std::vector<Eigen::Vector3d> residual_m;  ///< per point, nominal minus fitted, in Fb
  double chi2 = 0;                          ///< sum of their squares in units of sigma
  double dof = 0;                           ///< of chi2: 3 n - 6
};

/// Fits the tracker's frame by weighted least squares over all points, Eq. (M24).
/// \param sigma_m  standard deviation of each point per coordinate, of measurement and nominal position together
/// \param source   named in messages
/// \throws InputError  fewer than three points; not as many nominal points and sigmas; a sigma that is not positive; all
///                     points on one line within a thousandth of its length
FrameFit fit_frame(std::span<const Eigen::Vector3d> tracker_m, std::span<const Eigen::Vector3d> nominal_m,
                   std::span<const double> sigma_m, const std::string& source);

}  // namespace flexcomp::host
