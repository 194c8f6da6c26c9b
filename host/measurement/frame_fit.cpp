// SPDX-License-Identifier: Apache-2.0
#include "measurement/frame_fit.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include "input_error.hpp"
#include "linalg/decompositions.hpp"
#include "measurement/reflectors.hpp"

namespace flexcomp::host {

namespace {

/// Singular values of the points about their mean, descending: their spread along three axes, m.
Eigen::Vector3d spread(std::span<const Eigen::Vector3d> points) {
  Eigen::MatrixXd m(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t k = 0; k < points.size(); ++k) m.col(static_cast<Eigen::Index>(k)) = points[k];
  m.colwise() -= Eigen::Vector3d(m.rowwise().mean());
  return singular_values(m);
}

}  // namespace

FrameFit fit_frame(std::span<const Eigen::Vector3d> tracker_m, std::span<const Eigen::Vector3d> nominal_m,
                   std::span<const double> sigma_m, const std::string& source) {
  const std::size_t n = tracker_m.size();
  if (n < 3) throw InputError(source, 0, "points", "three points or more", fmt::format("{}", n));
  if (nominal_m.size() != n || sigma_m.size() != n) {
    throw InputError(source, 0, "points", fmt::format("{} nominal points and standard deviations", n),
                     fmt::format("{} and {}", nominal_m.size(), sigma_m.size()));
  }
  for (const double sigma : sigma_m) {
    if (!(sigma > 0))
      throw InputError(source, 0, "sigma", "a standard deviation above 0", fmt::format("{}", sigma));
  }
  for (const std::span<const Eigen::Vector3d> points : {tracker_m, nominal_m}) {
    const Eigen::Vector3d size = spread(points);
    if (!(size[1] > 1e-3 * size[0])) {
      throw InputError(source, 0, "points", "points that are not on one line",
                       fmt::format("{:.3g} mm across a line of {:.3g} mm", 1e3 * size[1], 1e3 * size[0]));
    }
  }
  FrameFit out;
  out.pose = fit_rigid(nominal_m, tracker_m, sigma_m).pose;
  out.covariance = inverse(fit_information(out.pose, tracker_m, sigma_m));
  for (std::size_t k = 0; k < n; ++k) {
    out.residual_m.emplace_back(nominal_m[k] - out.pose.rotation * tracker_m[k] - out.pose.position);
    out.chi2 += out.residual_m.back().squaredNorm() / (sigma_m[k] * sigma_m[k]);
  }
  out.dof = 3 * static_cast<double>(n) - 6;
  return out;
}

}  // namespace flexcomp::host
