// SPDX-License-Identifier: Apache-2.0
/// \file
/// Scans of the residual for faults that begin somewhere: a spline at a position of a joint, a step at a time.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "diagnosis/residual_analysis.hpp"
#include "measurement/observation.hpp"

namespace flexcomp::host {

/// Local fault of a joint: one cubic B-spline of its reading, on a knot spacing of 2 pi / `knots`.
struct LocalCurve {
  unsigned joint = 0;  ///< from 1
  std::size_t knots = 0;
  double centre_rad = 0;
  double gain = 0;  ///< over two parameters: size and centre (D7)

  double spacing_rad() const;
};

/// Best local faults of each joint (D7): `per_joint` of them, apart from each other, each at `least_touched` rows or more.
std::vector<LocalCurve> local_curves(const GapSystem& system, const ResidualAnalysis& left,
                                     const std::vector<Observation>& rows, std::size_t per_joint,
                                     std::size_t least_touched);
/// The spline of a local curve at every row.
Eigen::VectorXd local_values(const LocalCurve& curve, const std::vector<Observation>& rows);

/// A step of the measured point at a time.
struct Slip {
  double after_s = 0;
  double gain = 0;  ///< over four parameters: three translations and the time (D8)
};
/// The best times of a step, by gain (D8).
/// \param point_columns  whitened columns of the measured point's three translations
std::vector<Slip> slips(const GapSystem& system, const ResidualAnalysis& left,
                        const std::vector<Observation>& rows,
                        const std::array<Eigen::VectorXd, 3>& point_columns, std::size_t most);

}  // namespace flexcomp::host
