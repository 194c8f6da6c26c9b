// SPDX-License-Identifier: Apache-2.0
#include "exchange/imported_arm.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "exchange/axis_chain.hpp"
#include "input_error.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

constexpr double standard_gravity_m_s2 = 9.81;
/// A robot file, in millimetres, holds no longer length.
constexpr double largest_m = 1e300;

/// To 1e-4 m/s^2, or a hundred-thousandth of a radian: a base that is level but for rounding is level. The weight of
/// the links is modelled only there.
std::array<double, 3> gravity(const Eigen::Vector3d& down) {
  std::array<double, 3> out{};
  for (std::size_t k = 0; k < 3; ++k)
    out[k] = std::round(down[static_cast<Eigen::Index>(k)] * standard_gravity_m_s2 * 1e4) / 1e4 + 0.0;
  return out;
}

/// \throws InputError  a number that no robot file holds: those of the source are finite, but not what follows from them
void put_links(const LinkChain& links, const std::string& path, ImportedArm& arm) {
  std::vector<double> all{links.tool_xyz_m.begin(), links.tool_xyz_m.end()};
  all.insert(all.end(), links.tool_wxyz.begin(), links.tool_wxyz.end());
  for (const NominalLink& l : links.links)
    all.insert(all.end(), {l.theta_rad, l.d_m, l.a_m, l.alpha_rad, l.beta_rad});
  if (!std::all_of(all.begin(), all.end(), [](double v) { return std::abs(v) < largest_m; }) ||
      !links.base_to_f0.position.allFinite() || !links.base_to_f0.rotation.allFinite()) {
    throw InputError(path, 0, "", "an arm whose axes lie at finite places",
                     "lengths whose sums and products are beyond the range of numbers");
  }
  arm.robot.nominal.links = links.links;
  arm.robot.nominal.tool_xyz_m = links.tool_xyz_m;
  arm.robot.nominal.tool_wxyz = links.tool_wxyz;
  arm.base_to_f0 = links.base_to_f0;
  arm.f0_is_base = links.f0_is_base;
}

}  // namespace

ImportedArm import_urdf(const std::string& path, const UrdfLinks& links) {
  const UrdfArm from = load_urdf(path, links);
  ImportedArm arm;
  put_links(links_of(axes_of(from)), path, arm);
  arm.robot.path = path;
  arm.robot.name = from.name;
  for (std::size_t i = 0; i < joint_count; ++i) {
    arm.joints[i] = from.joints[i].name;
    const JointLimits& limits = from.joints[i].limits;
    arm.robot.nominal.limits[i] = {tidied(limits.min_rad, unit::degree),
                                   tidied(limits.max_rad, unit::degree)};
    arm.robot.max_speed_rad_s[i] = tidied(from.joints[i].max_speed_rad_s, unit::degree);
  }
  arm.robot.nominal.gravity_m_s2 = gravity(arm.base_to_f0.rotation.transpose() * from.down);
  arm.base = from.base;
  arm.flange = from.flange;
  arm.tip = from.tip;
  arm.warnings = from.warnings;
  return arm;
}

ImportedArm import_robot(const std::string& path) {
  ImportedArm arm;
  arm.robot = load_robot(path, LongLinks::taken);
  const auto before = link_frames(arm.robot.nominal);
  put_links(links_of(axes_of(arm.robot.nominal)), path, arm);
  const auto after = link_frames(arm.robot.nominal);
  const auto carried = [&](std::size_t frame, const Eigen::Vector3d& p) -> Eigen::Vector3d {
    return after[frame].rotation.transpose() *
           (before[frame].rotation * p + before[frame].position - after[frame].position);
  };
  const auto tidy = [](const Eigen::Vector3d& p) -> Eigen::Vector3d {
    return p.unaryExpr([](double v) { return tidied(v, unit::mm); });
  };
  auto& com = arm.robot.nominal.payload_com_m;
  const Eigen::Vector3d moved = tidy(carried(joint_count, {com[0], com[1], com[2]}));
  com = {moved.x(), moved.y(), moved.z()};
  for (Capsule& capsule : arm.robot.capsules) {
    capsule.from_m = tidy(carried(capsule.frame, capsule.from_m));
    capsule.to_m = tidy(carried(capsule.frame, capsule.to_m));
  }
  return arm;
}

}  // namespace flexcomp::host
