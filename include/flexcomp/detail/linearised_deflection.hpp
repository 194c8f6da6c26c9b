// SPDX-License-Identifier: Apache-2.0
/// \file
/// First-order change of the deflection by gravity (docs/compensation.md, C13).
#ifndef FLEXCOMP_DETAIL_LINEARISED_DEFLECTION_HPP
#define FLEXCOMP_DETAIL_LINEARISED_DEFLECTION_HPP

#include <array>
#include <cstddef>

#include "flexcomp/detail/statics.hpp"

namespace flexcomp {
namespace detail {

/// Deflection by loads of a chain whose axes are known, and its first-order change (C13): moments about axes in
/// F0, (M11). Only for gravity along z of F0 and without external force (StaticLoad::is_plain). The change
/// leaves out the second order and the motion of joints between a lever's ends: it is the start of (C15), not
/// its result.
template <class S, std::size_t N>
class LinearisedDeflection {
 public:
  template <class Cap>
  void set(const Model<S, N, Cap>& model, const std::array<JointAxis<S>, N>& joints,
           const FlangePose<S>& flange, const StaticLoad<S>& load, std::array<S, N>& delta) {
    const S weight = load.gravity.z * load.mass_kg;
    weight_ = weight;
    Vec3<S> load_at;
    flange_point(flange, load.com_m, load_at);
    const S ax = load_at.x, ay = load_at.y, az = load_at.z;
    for (std::size_t i = 0; i < N; ++i) {
      const JointAxis<S>& j = joints[i];
      const S zx = j.axis.x, zy = j.axis.y, zz = j.axis.z;
      const S rx = ax - j.origin.x, ry = ay - j.origin.y, rz = az - j.origin.z;
      arm_[i].x = zy * rz - zz * ry;
      arm_[i].y = zz * rx - zx * rz;
      delta[i] = (zx * ry - zy * rx) * weight * model.plan().compliance(i);
    }
    levers_ = 0;
    const S sign = load.gravity.z * model.plan().inverse_gravity();
    add_levers(
        model,
        [&](std::size_t joint, std::size_t distal) {
          const Vec3<S>& z = joints[joint].axis;
          const Vec3<S>&proximal = joints[joint].origin, &end = joints[distal].origin;
          const S rx = end.x - proximal.x, ry = end.y - proximal.y, rz = end.z - proximal.z;
          const S x = z.y * rz - z.z * ry, y = z.z * rx - z.x * rz, h = z.x * ry - z.y * rx;
          const S square = x * x + y * y + h * h;
          using std::sqrt;
          const S k = square > S(1e-6) ? sign / sqrt(square) : S(0);
          if (levers_ < max_levers) {
            lever_[levers_].x = x * k;
            lever_[levers_].y = y * k;
          }
          ++levers_;
          return h * k;
        },
        delta);
  }

  /// First-order change of the deflection (rad) when the joints turn by `by` (rad).
  template <class Cap>
  FLEXCOMP_ONCE void change(const Model<S, N, Cap>& model, const std::array<JointAxis<S>, N>& joints,
                            const std::array<S, N>& by, std::array<S, N>& delta) const {
    // The z of axis x arm gives the torque: joints further out move the arm's end, joints further in turn it
    // as a whole.
    S ux = S(0), uy = S(0);
    for (std::size_t i = N; i-- > 0;) {
      const S v = by[i];
      ux += arm_[i].x * v;
      uy += arm_[i].y * v;
      delta[i] = joints[i].axis.x * uy - joints[i].axis.y * ux;
    }
    std::array<Planar, N> turned;
    S wx = S(0), wy = S(0);
    const S weight = weight_;
    for (std::size_t i = 0; i < N; ++i) {
      const S v = by[i];
      S d = delta[i];
      d += wx * arm_[i].y;
      d -= wy * arm_[i].x;
      wx += joints[i].axis.x * v;
      wy += joints[i].axis.y * v;
      turned[i].x = wx;
      turned[i].y = wy;
      delta[i] = d * weight * model.plan().compliance(i);
    }
    if (levers_ > max_levers) return;
    const Planar* next = lever_.data();
    add_levers(
        model,
        [&](std::size_t joint, std::size_t) {
          const Planar& b = *next++;
          return turned[joint].x * b.y - turned[joint].y * b.x;
        },
        delta);
  }

 private:
  struct Planar {
    S x, y;
  };
  static constexpr std::size_t max_levers = 4;

  std::array<Planar, N> arm_;  ///< x, y of axis x (centre of mass - origin)
  /// x, y of axis x (distal - proximal origin) as a unit vector; its z is the lever.
  std::array<Planar, max_levers> lever_;
  std::size_t levers_;
  S weight_;
};

}  // namespace detail
}  // namespace flexcomp

#endif
