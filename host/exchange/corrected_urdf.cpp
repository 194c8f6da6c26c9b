// SPDX-License-Identifier: Apache-2.0
#include "exchange/corrected_urdf.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <utility>

#include "exchange/axis_chain.hpp"
#include "exchange/urdf_text.hpp"
#include "files/read_file.hpp"
#include "flexcomp/forward.hpp"
#include "flexcomp/model.hpp"
#include "input_error.hpp"
#include "linalg/decompositions.hpp"
#include "model/effects.hpp"
#include "model/frames.hpp"
#include "model/host_model.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

/// The rounding of a drawing's right angles (some 1e-9 rad) and of tables to 1e-10 mm stays far below.
constexpr double same_axis = 1e-6;
using Frames = std::array<Pose<double>, joint_count + 1>;

double angle_between(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return Eigen::AngleAxisd(Eigen::Matrix3d(a.transpose() * b)).angle();
}

/// The rigid transform that carries one arm's axes onto the other's: directions by the least squares of Kabsch, then the
/// distances of the lines, which are linear in the translation.
Pose<double> carry(const AxisChain& from, const AxisChain& to) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < joint_count; ++i)
    sum += to.axes[i].direction * from.axes[i].direction.transpose();
  Pose<double> out;
  out.rotation = nearest_rotation(sum);
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < joint_count; ++i) {
    const Eigen::Vector3d& w = to.axes[i].direction;
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - w * w.transpose();
    normal += across;
    right += across * (to.axes[i].point_m - out.rotation * from.axes[i].point_m);
  }
  out.position = shortest_least_squares(normal, right);
  return out;
}

/// Joint frames with all readings at zero, seen from the base.
std::array<Pose<double>, joint_count> joint_frames(const UrdfArm& arm) {
  std::array<Pose<double>, joint_count> out;
  Pose<double> frame;
  for (std::size_t i = 0; i < joint_count; ++i) out[i] = frame = frame * arm.joints[i].origin;
  return out;
}

/// From frame i - 1 to the URDF's frame of joint i, with the turn about z there being the turn about the URDF's axis here:
/// exactly, not to the rounding of the drawing.
Pose<double> on_axis(Pose<double> frame, const Eigen::Vector3d& axis) {
  const Eigen::Vector3d there = frame.rotation * axis;
  frame.rotation =
      Eigen::Quaterniond::FromTwoVectors(there, Eigen::Vector3d::UnitZ()).toRotationMatrix() * frame.rotation;
  frame.position.x() = frame.position.y() = 0;
  return frame;
}

/// The links, base and tool of the calibration: what the geometric terms make of the nominal ones.
struct Geometry {
  std::array<NominalLink, joint_count> links;
  Pose<double> base;
  Pose<double> tool;
};

Geometry geometry(const NominalRobot<joint_count>& nominal, const TermSet& set) {
  Geometry out;
  out.links = nominal.links;
  std::array<double, 6> base{};
  std::array<double, 6> tool{};
  for (const Term<double>& t : set.terms) {
    if (t.effect != Effect::geometric) continue;
    if (t.place.body == body::base) {
      base[t.place.slot] += t.coefficient;
    } else if (t.place.body == body::tool) {
      tool[t.place.slot] += t.coefficient;
    } else {
      NominalLink& link = out.links[t.place.body - 1U];
      const std::array<double*, 5> slots{&link.theta_rad, &link.d_m, &link.a_m, &link.alpha_rad,
                                         &link.beta_rad};
      *slots[t.place.slot] += t.coefficient;
    }
  }
  const auto& [w, x, y, z] = nominal.tool_wxyz;
  const auto& p = nominal.tool_xyz_m;
  out.base = small_pose(base);
  out.tool =
      Pose<double>{Eigen::Quaterniond(w, x, y, z).toRotationMatrix(), {p[0], p[1], p[2]}} * small_pose(tool);
  return out;
}

Pose<double> product(const std::vector<UrdfStep>& steps, std::size_t from, std::size_t to) {
  Pose<double> out;
  for (std::size_t k = from; k < to; ++k) out = out * steps[k].origin;
  return out;
}

}  // namespace

TermSet rigid_part(const TermSet& set) {
  TermSet out;
  for (const Term<double>& t : set.terms) {
    if (t.effect == Effect::geometric) out.terms.push_back(t);
  }
  return out;
}

CorrectedUrdf correct_urdf(const std::string& path, const UrdfLinks& links, const Robot& robot,
                           const Calibration& calibration) {
  const UrdfArm arm = load_urdf(path, links);
  const AxisChain drawn = axes_of(arm);
  const AxisChain ours = axes_of(robot.nominal);
  const Pose<double> base = carry(ours, drawn);
  for (std::size_t i = 0; i < joint_count; ++i) {
    const Eigen::Vector3d direction = base.rotation * ours.axes[i].direction;
    const double turned =
        std::atan2(direction.cross(drawn.axes[i].direction).norm(), direction.dot(drawn.axes[i].direction));
    const Eigen::Vector3d apart =
        base.rotation * ours.axes[i].point_m + base.position - drawn.axes[i].point_m;
    const double moved = (apart - drawn.axes[i].direction * apart.dot(drawn.axes[i].direction)).norm();
    if (turned < same_axis && moved < same_axis) continue;
    throw InputError(
        path, 0, fmt::format("joint '{}'", arm.joints[i].name),
        fmt::format("the axis of joint {} of {}", i + 1, robot.path),
        fmt::format("one that is {:.3g} mm and {:.3g} deg off: another arm", moved * 1e3, degrees(turned)),
        ErrorCode::another_arm);
  }

  // Frames of the drawing and of ours at zero; between them what stays constant.
  const Geometry nominal = geometry(robot.nominal, TermSet());
  const Geometry now = geometry(robot.nominal, calibration.terms);
  const auto drawn_frames = joint_frames(arm);
  std::array<Pose<double>, joint_count> k;
  Pose<double> frame = base;
  for (std::size_t i = 0; i < joint_count; ++i) {
    k[i] = on_axis(inverse(frame) * drawn_frames[i], arm.joints[i].axis);
    frame = frame * link_pose(nominal.links[i], 0);
  }
  const Pose<double> c6 = link_pose(nominal.links[5], 0);
  const Pose<double> c6_now = link_pose(now.links[5], 0);

  CorrectedUrdf out;
  out.base = arm.base;
  out.tip = arm.tip;
  std::map<std::string, Pose<double>> origins;
  const auto put = [&](const UrdfStep& step, const Pose<double>& origin) {
    const double moved = (origin.position - step.origin.position).norm();
    const double turned = angle_between(step.origin.rotation, origin.rotation);
    if (moved < rounding && turned < rounding) return;
    origins[step.joint] = origin;
    out.joints.push_back({step.joint, moved, turned});
  };
  Pose<double> before = arm.start;
  std::size_t joint = 0;
  std::size_t behind = 0;  // index of the first step after joint 6
  for (std::size_t s = 0; s < arm.steps.size() && joint < joint_count; ++s) {
    if (arm.steps[s].turning) {
      const Pose<double> whole = joint == 0
                                     ? base * now.base * k[0]
                                     : inverse(k[joint - 1]) * link_pose(now.links[joint - 1], 0) * k[joint];
      put(arm.steps[s], inverse(before) * whole);
      before = Pose<double>();
      ++joint;
      behind = s + 1;
    } else {
      before = before * arm.steps[s].origin;
    }
  }
  const Pose<double> from_nominal = inverse(c6) * k[5];
  const Pose<double> flange = inverse(k[5]) * c6_now * from_nominal * arm.flange_after;
  const Pose<double> tip =
      inverse(k[5]) * c6_now * now.tool * inverse(nominal.tool) * from_nominal * arm.tip_after;
  const std::size_t end = arm.steps.size();
  const std::size_t at_flange = behind + arm.flange_steps;
  if (behind < at_flange && at_flange < end) {
    put(arm.steps[behind], flange * inverse(product(arm.steps, behind + 1, at_flange)));
    put(arm.steps[at_flange], inverse(flange) * tip * inverse(product(arm.steps, at_flange + 1, end)));
  } else if (behind < end) {
    put(arm.steps[behind], tip * inverse(product(arm.steps, behind + 1, end)));
  }
  std::optional<AddedLink> added;
  out.added_tip = behind == end && (tip.position.norm() > rounding ||
                                    angle_between(tip.rotation, Eigen::Matrix3d::Identity()) > rounding);
  if (out.added_tip) {
    added = {arm.tip, "_calibrated", tip};
    out.tip += added->suffix;
  }
  out.text = with_origins(path, read_file(path), origins, added);
  return out;
}

LeftOut left_out_by_rigid(const Calibration& calibration, const Robot& robot, std::size_t poses) {
  const TermSet& set = calibration.terms;
  LeftOut out;
  out.poses = poses;
  const auto rigid = prepare(rigid_part(set), robot, calibration.path);
  const auto whole = prepare(set, robot, calibration.path);
  std::vector<std::unique_ptr<HostModel>> single;
  for (const EffectGroup& group : effects_of(set, robot.nominal)) {
    if (belongs_to_measurement(group.id.effect)) continue;
    TermSet one = rigid_part(set);
    one.tables = set.tables;
    one.values = set.values;
    // The values of a curve are parameters of one term.
    std::set<std::size_t> of_group;
    for (const Parameter& p : group.parameters) of_group.insert(p.terms.begin(), p.terms.end());
    for (const std::size_t t : of_group) one.terms.push_back(set.terms[t]);
    single.push_back(prepare(one, robot, calibration.path));
    out.effects.push_back({name(group.id), 0, 0});
  }
  if (out.effects.empty()) return out;
  std::mt19937_64 random(1);
  Workspace<double, joint_count> workspace;
  for (std::size_t n = 0; n < poses; ++n) {
    std::array<double, joint_count> q{};
    auto context = default_context<double>(robot.nominal);
    if (n % 2 == 1) context.payload_kg = 0;
    for (std::size_t j = 0; j < joint_count; ++j) {
      const JointLimits& l = robot.nominal.limits[j];
      q[j] = std::uniform_real_distribution<double>(l.min_rad, l.max_rad)(random);
      context.direction[j] = random() % 2 == 0 ? 1 : -1;
    }
    const Pose<double> from = forward(*rigid, q, context, workspace);
    const auto add = [&](const HostModel& model, double& largest_m, double& largest_rad) {
      const Pose<double> to = forward(model, q, context, workspace);
      largest_m = std::max(largest_m, (to.position - from.position).norm());
      largest_rad = std::max(largest_rad, angle_between(from.rotation, to.rotation));
    };
    add(*whole, out.largest_m, out.largest_rad);
    for (std::size_t k = 0; k < single.size(); ++k)
      add(*single[k], out.effects[k].largest_m, out.effects[k].largest_rad);
  }
  return out;
}

}  // namespace flexcomp::host
