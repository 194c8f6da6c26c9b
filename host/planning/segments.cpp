#include "planning/segments.hpp"

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
  // The nearest points lie inside both segments (then on the common perpendicular of the two lines), or one of them is an
  // end. Nearly parallel lines leave the perpendicular's place open, by as little as it then matters; the ends are asked
  // besides, so that no case needs a threshold.
  const Eigen::Vector3d u = a.to - a.from;
  const Eigen::Vector3d v = b.to - b.from;
  const Eigen::Vector3d w = a.from - b.from;
  const double uu = u.squaredNorm();
  const double uv = u.dot(v);
  const double vv = v.squaredNorm();
  const double uw = u.dot(w);
  const double vw = v.dot(w);
  const double determinant = uu * vv - uv * uv;
  double least = -1;
  if (determinant > 0) {
    const double s = uv * vw - vv * uw;
    const double t = uu * vw - uv * uw;
    if (s > 0 && s < determinant && t > 0 && t < determinant) {
      least = (w + (s / determinant) * u - (t / determinant) * v).squaredNorm();
      if (determinant > 1e-6 * uu * vv) return least;
    }
  }
  const double ends = std::min(std::min(squared_distance(a.from, b), squared_distance(a.to, b)),
                               std::min(squared_distance(b.from, a), squared_distance(b.to, a)));
  return least < 0 ? ends : std::min(least, ends);
}

}  // namespace flexcomp::host
