// SPDX-License-Identifier: Apache-2.0
#include "planning/segments.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace flexcomp::host {

double squared_distance(const Eigen::Vector3d& point, const Segment& segment) {
  const Eigen::Vector3d along = segment.to - segment.from;
  const Eigen::Vector3d to_point = point - segment.from;
  const double square = along.squaredNorm();
  if (!(square > 0)) return to_point.squaredNorm();
  const double t = std::clamp(along.dot(to_point) / square, 0.0, 1.0);
  return (to_point - t * along).squaredNorm();
}

double squared_distance(const Segment& a, const Segment& b) {
  // The nearest points lie inside both segments, on the common perpendicular of their lines, or one of them is
  // an end. For nearly parallel lines the perpendicular is ill-conditioned, but the ends are compared as well,
  // so no case needs a threshold. Cross products, because uu * vv - uv * uv would lose twice as many digits.
  const Eigen::Vector3d u = a.to - a.from;
  const Eigen::Vector3d v = b.to - b.from;
  const Eigen::Vector3d w = b.from - a.from;
  const Eigen::Vector3d n = u.cross(v);
  const double nn = n.squaredNorm();
  double least = -1;
  if (nn > 0) {
    const double s = w.cross(v).dot(n);
    const double t = w.cross(u).dot(n);
    if (s > 0 && s < nn && t > 0 && t < nn) {
      least = ((s / nn) * u - (t / nn) * v - w).squaredNorm();
      if (nn > 1e-6 * u.squaredNorm() * v.squaredNorm()) return least;
    }
  }
  const double ends = std::min(std::min(squared_distance(a.from, b), squared_distance(a.to, b)),
                               std::min(squared_distance(b.from, a), squared_distance(b.to, a)));
  return least < 0 ? ends : std::min(least, ends);
}

}  // namespace flexcomp::host
