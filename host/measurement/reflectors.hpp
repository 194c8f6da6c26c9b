// SPDX-License-Identifier: Apache-2.0
/// \file
/// Rigid fit of reflector points A, B, C(, D) to a template, and the template where none is known.
#ifndef FLEXCOMP_HOST_MEASUREMENT_REFLECTORS_HPP
#define FLEXCOMP_HOST_MEASUREMENT_REFLECTORS_HPP

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "flexcomp/linear.hpp"

namespace flexcomp::host {

using Points = std::vector<Eigen::Vector3d>;

struct RigidFit {
  Pose<double> pose;      ///< points = pose * template, in the least-squares sense
  double squares_m2 = 0;  ///< sum of squared distances that remain
};

/// Least squares over all points (Arun, Umeyama). Needs three points that are not on one line.
RigidFit fit_rigid(std::span<const Eigen::Vector3d> measured_m, std::span<const Eigen::Vector3d> template_m);

/// The same with a standard deviation for each point, m, which all of its coordinates share.
RigidFit fit_rigid(std::span<const Eigen::Vector3d> measured_m, std::span<const Eigen::Vector3d> template_m,
                   std::span<const double> sigma_m);

/// Frame of the paper (Section 3.2): origin the foot of the perpendicular from B on AC, X from B to it, Y from C to A,
/// Z = X x Y. Returns the pose of that frame in the frame of the points.
Pose<double> reflector_frame(std::span<const Eigen::Vector3d> points_m);

/// Mean shape over all rows (generalised Procrustes), in reflector_frame()'s gauge.
Points estimate_template(const std::vector<Points>& rows_m);

/// True where the first three points lie on one line within a tenth of a millimetre: they define no orientation.
bool on_one_line(std::span<const Eigen::Vector3d> points_m);

/// Information matrix (inverse covariance) of [position; rotation vector], both in the measurement frame, of a fit whose
/// points have the standard deviation sigma_m in each coordinate.
Eigen::Matrix<double, 6, 6> fit_information(const Pose<double>& pose,
                                            std::span<const Eigen::Vector3d> template_m, double sigma_m);
Eigen::Matrix<double, 6, 6> fit_information(const Pose<double>& pose,
                                            std::span<const Eigen::Vector3d> template_m,
                                            std::span<const double> sigma_m);

/// Probability of a chi-square of 3 or 6 degrees of freedom (three or four points) above this value.
double misfit_probability(double chi2, std::size_t dof);

/// Which reflector moved, as far as the distances between them tell.
///
/// A move changes the distances to the others and leaves those among the others. Where only one distance has changed, as
/// with three reflectors when one slips across the line to a second, either end may have moved; where one of four in a
/// plane leaves it, any of them may. Then all that are possible are named.
struct Suspicion {
  std::vector<double> probability;  ///< per reflector, together 1: that it moved, given that one alone did
  std::vector<std::size_t> named;  ///< the fewest that hold 99 % of it, most likely first; 0 … 3 for A … D
  bool several = false;  ///< no move of a single one explains the distances: two moved, or another template
};

/// From rows in which the same slip stands: their mean is as if the noise sigma_m (m, per coordinate of a point) were
/// smaller. Every reflector is taken as likely to move, by any amount (as likely by 0.1 to 1 as by 1 to 10 mm) in any
/// direction.
Suspicion suspect_reflectors(const std::vector<Points>& rows_m, std::span<const Eigen::Vector3d> template_m,
                             double sigma_m);

/// Whether these rows show one and the same shape, but for the noise (probability above 1e-4).
bool same_shape(const std::vector<Points>& rows_m, double sigma_m);

}  // namespace flexcomp::host

#endif
