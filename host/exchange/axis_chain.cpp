// SPDX-License-Identifier: Apache-2.0
#include "exchange/axis_chain.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "model/frames.hpp"
#include "quaternion.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

Eigen::Matrix3d rot(const Eigen::Vector3d& axis, double angle) {
  return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

AxisLine seen_from(const Pose<double>& frame, const AxisLine& line) {
  return {frame.rotation.transpose() * (line.point_m - frame.position),
          frame.rotation.transpose() * line.direction};
}

/// The frame nearest to 1 whose z axis is this line.
Pose<double> nearest_frame(const AxisLine& line) {
  Pose<double> frame;
  const Eigen::Vector3d& w = line.direction;
  const double sine = std::hypot(w.x(), w.y());
  if (sine < rounding) {
    // Half a turn has no nearest axis; about x it keeps what is in front in front.
    if (w.z() < 0) frame.rotation = Eigen::Vector3d(1, -1, -1).asDiagonal();
  } else {
    frame.rotation = rot(Eigen::Vector3d(-w.y(), w.x(), 0) / sine, std::atan2(sine, w.z()));
  }
  frame.position = line.point_m - w * w.dot(line.point_m);
  if (frame.position.norm() < rounding) frame.position.setZero();
  return frame;
}

/// Of the two readings of a link, (theta, a, alpha, beta) and (theta + 180, -a, -alpha, -beta), the one that turns less;
/// at 90 degrees the one with a > 0, then with alpha > 0.
void choose_reading(NominalLink& link) {
  constexpr double tie = 1e-9;
  const double excess = std::abs(link.theta_rad) - pi / 2;
  const bool other =
      excess > tie || (excess > -tie && (link.a_m < -tie || (link.a_m < tie && link.alpha_rad < -tie)));
  if (!other) return;
  link.theta_rad -= std::copysign(pi, link.theta_rad);
  link.a_m = -link.a_m;
  link.alpha_rad = -link.alpha_rad;
  link.beta_rad = -link.beta_rad;
}

NominalLink tidied(NominalLink link) {
  link.theta_rad = tidied(link.theta_rad, unit::degree);
  link.d_m = tidied(link.d_m, unit::mm);
  link.a_m = tidied(link.a_m, unit::mm);
  link.alpha_rad = tidied(link.alpha_rad, unit::degree);
  link.beta_rad = tidied(link.beta_rad, unit::degree);
  return link;
}

/// The link that leads from a frame to the next axis, which is seen from that frame.
NominalLink link_to(const AxisLine& next) {
  const Eigen::Vector3d& p = next.point_m;
  const Eigen::Vector3d& w = next.direction;
  const double sine = std::hypot(w.x(), w.y());
  NominalLink link;
  if (sine > std::sin(parallel_within_rad)) {
    // x along z × w; the feet of the common normal on both axes.
    const Eigen::Vector3d x(-w.y() / sine, w.x() / sine, 0);
    link.theta_rad = std::atan2(x.y(), x.x());
    link.a_m = p.dot(x);
    link.alpha_rad = std::atan2(sine, w.z());
    // Along the next axis, until the distance to this one is the common normal.
    const double along = -(p.x() * w.x() + p.y() * w.y()) / (sine * sine);
    link.d_m = p.z() + along * w.z();
  } else {
    // Where the next axis pierces the plane of this frame's x and y.
    const Eigen::Vector3d o = p - w * (p.z() / w.z());
    link.a_m = std::hypot(o.x(), o.y());
    if (link.a_m < rounding) {
      link.a_m = 0;  // the same point: the drawing names no direction
    } else {
      link.theta_rad = std::atan2(o.y(), o.x());
    }
    // Rot(x,alpha) Rot(y,beta) e_z = (sin beta, -sin alpha cos beta, cos alpha cos beta)
    const Eigen::Vector3d v = rot(Eigen::Vector3d::UnitZ(), -link.theta_rad) * w;
    link.beta_rad = std::asin(std::clamp(v.x(), -1.0, 1.0));
    link.alpha_rad = std::atan2(-v.y(), v.z());
  }
  choose_reading(link);
  return link;
}

/// Link 6, which leads from a frame on axis 6 to the flange as far as it can.
NominalLink link_to_flange(const Pose<double>& flange) {
  NominalLink link;
  Eigen::Matrix3d turned = flange.rotation;
  // Across (cosine 0) counts as along, also where rounding tips it.
  if (turned(2, 2) < -1e-6) {
    link.alpha_rad = pi;
    turned = turned * Eigen::Vector3d(1, -1, -1).asDiagonal();
  }
  // The part of the rotation that is about z; with the z axes less than a right angle apart there is one.
  const Eigen::Quaterniond q(turned);
  link.theta_rad = 2 * std::atan2(q.z(), q.w());
  if (link.theta_rad > pi) link.theta_rad -= 2 * pi;
  if (link.theta_rad <= -pi) link.theta_rad += 2 * pi;
  link.d_m = flange.position.z();
  return link;
}

}  // namespace

Pose<double> link_pose(const NominalLink& link, double q_rad) {
  Pose<double> pose;
  const Eigen::Matrix3d turn = rot(Eigen::Vector3d::UnitZ(), link.theta_rad + q_rad);
  pose.position = turn * Eigen::Vector3d(link.a_m, 0, link.d_m);
  pose.rotation =
      turn * rot(Eigen::Vector3d::UnitX(), link.alpha_rad) * rot(Eigen::Vector3d::UnitY(), link.beta_rad);
  return pose;
}

std::array<Pose<double>, joint_count + 1> link_frames(const NominalRobot<joint_count>& robot,
                                                      const std::array<double, joint_count>& q_rad) {
  std::array<Pose<double>, joint_count + 1> frames;
  for (std::size_t i = 0; i < joint_count; ++i)
    frames[i + 1] = frames[i] * link_pose(robot.links[i], q_rad[i]);
  return frames;
}

Pose<double> tool_pose(const NominalRobot<joint_count>& robot) {
  const auto& [w, x, y, z] = robot.tool_wxyz;
  const auto& t = robot.tool_xyz_m;
  return {Eigen::Quaterniond(w, x, y, z).toRotationMatrix(), {t[0], t[1], t[2]}};
}

LinkChain links_of(const AxisChain& chain) {
  LinkChain out;
  out.base_to_f0 = nearest_frame(chain.axes[0]);
  out.f0_is_base = out.base_to_f0.rotation.isIdentity(0) && out.base_to_f0.position.isZero(0);
  Pose<double> frame = out.base_to_f0;
  for (std::size_t i = 0; i < joint_count; ++i) {
    const bool last = i + 1 == joint_count;
    // From the rounded links so far: what rounding leaves is taken up by the next one, and in the end by the tool.
    out.links[i] = tidied(last ? link_to_flange(inverse(frame) * chain.flange)
                               : link_to(seen_from(frame, chain.axes[i + 1])));
    frame = frame * link_pose(out.links[i], 0);
  }
  const Pose<double> tool = inverse(frame) * chain.tip;
  for (std::size_t k = 0; k < 3; ++k)
    out.tool_xyz_m[k] = tidied(tool.position[static_cast<Eigen::Index>(k)], unit::mm);
  // Parts that rounding made become 0, so that a turn of 0 or 90 degrees reads as one; the norm stays 1.
  Eigen::Quaterniond q = unit_quaternion(tool.rotation);
  for (double& part : q.coeffs()) {
    if (std::abs(part) < 5 * rounding) part = 0;
  }
  q = *unit_quaternion(std::array<double, 4>{q.w(), q.x(), q.y(), q.z()});
  out.tool_wxyz = {q.w(), q.x(), q.y(), q.z()};
  return out;
}

AxisChain axes_of(const UrdfArm& arm) {
  AxisChain chain;
  Pose<double> frame;
  for (std::size_t i = 0; i < joint_count; ++i) {
    frame = frame * arm.joints[i].origin;
    chain.axes[i] = {frame.position, frame.rotation * arm.joints[i].axis};
  }
  chain.flange = frame * arm.flange_after;
  chain.tip = frame * arm.tip_after;
  return chain;
}

AxisChain axes_of(const NominalRobot<joint_count>& robot) {
  AxisChain chain;
  const auto frames = link_frames(robot);
  for (std::size_t i = 0; i < joint_count; ++i)
    chain.axes[i] = {frames[i].position, frames[i].rotation.col(2)};
  chain.flange = frames.back();
  chain.tip = chain.flange * tool_pose(robot);
  return chain;
}

}  // namespace flexcomp::host
