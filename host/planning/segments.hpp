// SPDX-License-Identifier: Apache-2.0
/// \file
/// Exact distances between segments.
#pragma once

#include <Eigen/Core>

namespace flexcomp::host {

/// Line segment, m; a point where both ends are equal.
struct Segment {
  Eigen::Vector3d from;
  Eigen::Vector3d to;
};

/// Squared distance of a point from a segment, m².
double squared_distance(const Eigen::Vector3d& point, const Segment& segment);

/// Squared distance of two segments, m²; exact also for crossing, parallel and degenerate ones.
double squared_distance(const Segment& a, const Segment& b);

}  // namespace flexcomp::host
