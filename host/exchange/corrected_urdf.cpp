// SPDX-License-Identifier: Apache-2.0
#include "exchange/corrected_urdf.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "exchange/axis_chain.hpp"
#include "exchange/rotation_angles.hpp"
#include "exchange/text_edits.hpp"
#include "exchange/xml.hpp"
#include "files/read_file.hpp"
#include "input_error.hpp"
#include "linalg/decompositions.hpp"
#include "model/effects.hpp"
#include "model/frames.hpp"
#include "model/set_difference.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

/// The rounding of a drawing's right angles (some 1e-9 rad) and of tables to 1e-10 mm stays far below.
constexpr double same_axis = 1e-6;

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
  out.base = small_pose(base);
  out.tool = tool_pose(nominal) * small_pose(tool);
  return out;
}

Pose<double> product(const std::vector<UrdfStep>& steps, std::size_t from, std::size_t to) {
  Pose<double> out;
  for (std::size_t k = from; k < to; ++k) out = out * steps[k].origin;
  return out;
}

// --- the text of a URDF with the origins of some joints replaced and every other byte as it was ---------------------

/// A link to be added before the end of the robot, on a fixed joint.
struct AddedLink {
  std::string parent;
  std::string suffix;  ///< its name is the parent's with this behind
  Pose<double> origin;
};

std::string numbers(const Eigen::Vector3d& v) {
  // To 1e-15: what arithmetic made 0.29999999999999993 is 0.3 again, and a zero is a zero.
  const auto plain = [](double x) {
    const double rounded = std::round(x * 1e15) / 1e15;
    return rounded == 0 ? std::string("0") : fmt::format("{:.15g}", rounded);
  };
  return fmt::format("{} {} {}", plain(v.x()), plain(v.y()), plain(v.z()));
}

std::string xyz(const Pose<double>& pose) { return numbers(pose.position); }
std::string rpy(const Pose<double>& pose) { return numbers(roll_pitch_yaw(pose.rotation)); }

std::string origin_tag(const Pose<double>& pose) {
  return fmt::format("<origin xyz=\"{}\" rpy=\"{}\"/>", xyz(pose), rpy(pose));
}

void set_origin(const XmlElement& joint, const Pose<double>& pose, TextEdits& edits) {
  const XmlElement* const origin = joint.child("origin");
  if (origin == nullptr) return edits.replace({joint.start_tag.end, joint.start_tag.end}, origin_tag(pose));
  std::string missing;
  const auto set = [&](const char* name, const std::string& value) {
    if (const XmlAttribute* const attribute = origin->attribute(name)) {
      edits.replace(attribute->span, value);
    } else {
      missing += fmt::format(" {}=\"{}\"", name, value);
    }
  };
  set("xyz", xyz(pose));
  set("rpy", rpy(pose));
  const std::size_t behind_name = origin->start_tag.begin + 1 + origin->name.size();
  if (!missing.empty()) edits.replace({behind_name, behind_name}, missing);
}

void add_link(const XmlElement& robot, const std::string& text, const AddedLink& added, TextEdits& edits) {
  for (const XmlElement& link : robot.children) {
    const XmlAttribute* const name = link.attribute("name");
    if (link.name != "link" || name == nullptr || name->value != added.parent) continue;
    // As written there, thus in the document's encoding and with its references.
    const std::string parent = text.substr(name->span.begin, name->span.end - name->span.begin);
    const char quote = text[name->span.end];
    const std::string child = parent + added.suffix;
    return edits.replace(
        {robot.end_tag, robot.end_tag},
        fmt::format("  <link name={0}{2}{0}/>\n  <joint name={0}{2}_joint{0} type=\"fixed\"><parent "
                    "link={0}{1}{0}/><child link={0}{2}{0}/>{3}</joint>\n",
                    quote, parent, child, origin_tag(added.origin)));
  }
  throw std::invalid_argument("a link that is not in the text");
}

/// Sets xyz and rpy of these joints' origins, rounded to 1e-15 m and rad; a joint without <origin> gets one.
/// \throws InputError  as parse_xml()
/// \throws std::invalid_argument  a joint or link that the text does not have under <robot>, or has twice
std::string with_origins(const std::string& path, const std::string& text,
                         const std::map<std::string, Pose<double>>& origins,
                         const std::optional<AddedLink>& added) {
  const XmlElement robot = parse_xml(path, text);
  TextEdits edits;
  std::size_t found = 0;
  for (const XmlElement& joint : robot.children) {
    const XmlAttribute* const name = joint.attribute("name");
    if (joint.name != "joint" || name == nullptr) continue;
    const auto origin = origins.find(name->value);
    if (origin == origins.end()) continue;
    ++found;
    set_origin(joint, origin->second, edits);
  }
  if (found != origins.size()) throw std::invalid_argument("a joint that is not in the text, or twice");
  if (added) add_link(robot, text, *added, edits);
  return edits.applied_to(text);
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
  std::vector<TermSet> single;
  for (const EffectGroup& group : effects_of(set, robot.nominal)) {
    if (belongs_to_measurement(group.id.effect)) continue;
    TermSet one = rigid_part(set);
    one.tables = set.tables;
    one.values = set.values;
    // The values of a curve are parameters of one term.
    std::set<std::size_t> of_group;
    for (const Parameter& p : group.parameters) of_group.insert(p.terms.begin(), p.terms.end());
    for (const std::size_t t : of_group) one.terms.push_back(set.terms[t]);
    single.push_back(std::move(one));
    out.effects.push_back({name(group.id), 0, 0});
  }
  if (out.effects.empty()) return out;
  std::vector<RandomPlace> places = random_places(robot, poses);
  for (std::size_t n = 1; n < places.size(); n += 2) places[n].context.payload_kg = 0;
  const auto at_all = [&](const TermSet& terms) { return poses_of(terms, robot, places, calibration.path); };
  const std::vector<Pose<double>> from = at_all(rigid_part(set));
  const ToolShift all = tool_shift(from, at_all(set));
  out.largest_m = all.largest_m;
  out.largest_rad = all.largest_rad;
  for (std::size_t k = 0; k < single.size(); ++k) {
    const ToolShift alone = tool_shift(from, at_all(single[k]));
    out.effects[k].largest_m = alone.largest_m;
    out.effects[k].largest_rad = alone.largest_rad;
  }
  return out;
}

}  // namespace flexcomp::host
