// SPDX-License-Identifier: Apache-2.0
/// \file
/// Rigid fit of reflector points A, B, C(, D) to a template, and estimation of the template.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "flexcomp/linear.hpp"

namespace flexcomp::host {

using Points = std::vector<Eigen::Vector3d>;

/// Result of fit_rigid(): points = pose * template in the least-squares sense.
struct RigidFit {
  Pose<double> pose;
  double squares_m2 = 0;  ///< sum of squared residuals
};

/// Fits a rigid transform by least squares, Eq. (M24) (Arun, Umeyama). Needs three points that are not on one line.
RigidFit fit_rigid(std::span<const Eigen::Vector3d> measured_m, std::span<const Eigen::Vector3d> template_m);

/// The same, weighted. \param sigma_m  standard deviation of each point per coordinate
RigidFit fit_rigid(std::span<const Eigen::Vector3d> measured_m, std::span<const Eigen::Vector3d> template_m,
                   std::span<const double> sigma_m);

/// Frame of three reflectors in the frame of the points, Eq. (M23): origin at the foot of the perpendicular
/// from B on AC, X from B to it, Y from C to A, Z = X x Y.
Pose<double> reflector_frame(std::span<const Eigen::Vector3d> points_m);

/// Mean shape over all rows (generalised Procrustes), in reflector_frame()'s gauge.
Points estimate_template(const std::vector<Points>& rows_m);

/// True where the first three points lie on one line within 0.1 mm: they define no orientation.
bool on_one_line(std::span<const Eigen::Vector3d> points_m);

/// Information matrix (inverse covariance) of [position; rotation vector] of a fit, both in the measurement frame,
/// Eq. (M25). \param sigma_m  standard deviation of the points per coordinate
Eigen::Matrix<double, 6, 6> fit_information(const Pose<double>& pose,
                                            std::span<const Eigen::Vector3d> template_m, double sigma_m);
Eigen::Matrix<double, 6, 6> fit_information(const Pose<double>& pose,
                                            std::span<const Eigen::Vector3d> template_m,
                                            std::span<const double> sigma_m);

/// Upper tail probability of the chi-square distribution with 3 or 6 degrees of freedom (three or four points), (M26).
double misfit_probability(double chi2, std::size_t dof);

/// Posterior probability that each reflector moved, from the distances between them.
///
/// A moved reflector changes the distances to the others but not those among the others. Where only one distance has
/// changed, either end may have moved; where one of four coplanar reflectors leaves the plane, any of them may.
struct Suspicion {
  std::vector<double> probability;  ///< per reflector, sum 1: that it moved, given that exactly one did
  std::vector<std::size_t> named;  ///< smallest set with 99 % probability, most likely first; 0 … 3 for A … D
  bool several =
      false;  ///< one moved reflector does not explain the distances: two moved, or another template
};

/// Computes which reflector moved from rows with the same shape, whose mean reduces the noise sigma_m (m, per
/// coordinate). Prior: all reflectors are equally likely to move, with log-uniform distance, in any direction.
Suspicion suspect_reflectors(const std::vector<Points>& rows_m, std::span<const Eigen::Vector3d> template_m,
                             double sigma_m);

/// True where these rows have the same shape within the noise (probability above 1e-4).
bool same_shape(const std::vector<Points>& rows_m, double sigma_m);

}  // namespace flexcomp::host
