// SPDX-License-Identifier: Apache-2.0
#include "exchange/urdf_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "exchange/urdf_tree.hpp"
#include "input_error.hpp"
#include "model/frames.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

/// Limits wider than this are a way of writing "none".
constexpr double widest_rad = 20 * pi;

/// From the root down to this link.
std::vector<const UrdfLinkNode*> ancestry(const UrdfLinkNode* link) {
  std::vector<const UrdfLinkNode*> way;
  for (;; link = link->parent_joint->parent) {
    way.push_back(link);
    if (link->parent_joint == nullptr) break;
  }
  std::reverse(way.begin(), way.end());
  return way;
}

std::size_t turning_joints(const std::vector<const UrdfLinkNode*>& way) {
  return static_cast<std::size_t>(std::count_if(way.begin(), way.end(), [](const UrdfLinkNode* link) {
    return link->parent_joint != nullptr && link->parent_joint->is_turning();
  }));
}

/// Where links part: the number of links that both ways share.
std::size_t shared(const std::vector<const UrdfLinkNode*>& a, const std::vector<const UrdfLinkNode*>& b) {
  const auto [first, second] = std::mismatch(a.begin(), a.end(), b.begin(), b.end());
  return static_cast<std::size_t>(first - a.begin());
}

const UrdfLinkNode* find_tip(const UrdfTree& tree, const std::vector<const UrdfLinkNode*>& to_base) {
  std::vector<const UrdfLinkNode*> tips;
  std::vector<std::string> ends;
  for (const auto& entry : tree.links()) {
    const UrdfLinkNode* const link = &entry.second;
    if (!link->children.empty()) continue;
    std::vector<const UrdfLinkNode*> way = ancestry(link);
    way.erase(way.begin(), way.begin() + static_cast<std::ptrdiff_t>(shared(way, to_base)));
    const std::size_t turning = turning_joints(way);
    if (turning == joint_count) tips.push_back(link);
    ends.push_back(fmt::format("{} after {}", link->name, turning));
  }
  if (tips.size() == 1) return tips.front();
  if (tips.empty()) {
    throw tree.argument_error(
        "tip", "a link that is six revolute or continuous joints away from " + to_base.back()->name,
        fmt::format("ends {}", fmt::join(ends, ", ")));
  }
  std::vector<std::string> names;
  for (const UrdfLinkNode* tip : tips) names.push_back(tip->name);
  throw tree.argument_error("tip", "to be told which of several links to take",
                            fmt::format("{}", fmt::join(names, ", ")));
}

void read_motion(const UrdfTree& tree, const UrdfJointNode& from, UrdfJoint& joint,
                 std::vector<std::string>& warnings) {
  if (const XmlElement* const mimic = from.element->child("mimic")) {
    throw tree.error(from, "a joint that moves by itself",
                     "one that mimics " + text_of(mimic->attribute("joint")));
  }
  joint.axis = tree.axis(from);
  joint.max_speed_rad_s = std::max(0.0, tree.limit(from, "velocity").value_or(0));
  const bool bounded = from.type == "revolute";
  if (bounded && from.element->child("limit") == nullptr)
    throw tree.error(from, "a <limit>, as a URDF's revolute joints have", "none");
  const double lower = tree.limit(from, "lower").value_or(0);
  const double upper = tree.limit(from, "upper").value_or(0);
  if (bounded && !(lower < upper))
    throw tree.error(from, "a lower limit below the upper one", fmt::format("{} and {} rad", lower, upper));
  if (bounded && lower > -widest_rad && upper < widest_rad) {
    joint.limits = {lower, upper};
  } else {
    warnings.push_back(
        fmt::format("joint '{}' has no limits in the file; taken as +-360 degrees", from.name));
  }
}

/// The flange's place on the way to the tip.
std::size_t find_flange(const UrdfTree& tree, const std::vector<const UrdfLinkNode*>& way,
                        std::size_t last_joint, const std::string& name) {
  if (!name.empty()) {
    const UrdfLinkNode* const wanted = tree.link("flange", name);
    const auto at = std::find(way.begin() + static_cast<std::ptrdiff_t>(last_joint), way.end(), wanted);
    if (at == way.end()) {
      throw tree.argument_error("flange",
                                fmt::format("a link from {} to {}", way[last_joint]->name, way.back()->name),
                                "'" + name + "'");
    }
    return static_cast<std::size_t>(at - way.begin());
  }
  for (std::size_t k = last_joint; k < way.size(); ++k) {
    if (way[k]->name.ends_with("tool0")) return k;
  }
  return way.size() - 1;
}

}  // namespace

UrdfArm load_urdf(const std::string& path, const UrdfLinks& links) {
  const UrdfTree tree(path);
  UrdfArm arm;
  arm.name = tree.name();
  const std::vector<const UrdfLinkNode*> to_base =
      ancestry(links.base.empty() ? tree.root() : tree.link("base", links.base));
  const UrdfLinkNode* const tip = links.tip.empty() ? find_tip(tree, to_base) : tree.link("tip", links.tip);
  const std::vector<const UrdfLinkNode*> way = ancestry(tip);
  const std::size_t fork = shared(way, to_base);
  arm.base = to_base.back()->name;
  arm.tip = tip->name;

  // Up from the base to where its way and the tip's part.
  Pose<double> root_to_base;
  for (std::size_t k = 1; k < to_base.size(); ++k) {
    const UrdfJointNode& joint = *to_base[k]->parent_joint;
    if (!joint.is_fixed() && k >= fork) {
      throw tree.error(joint, "fixed joints alone between the base and the arm",
                       "a joint that is " + joint.type);
    }
    root_to_base = root_to_base * tree.origin(joint);
  }
  arm.down = root_to_base.rotation.transpose() * -Eigen::Vector3d::UnitZ();
  Pose<double> fork_to_base;
  for (std::size_t k = fork; k < to_base.size(); ++k)
    fork_to_base = fork_to_base * tree.origin(*to_base[k]->parent_joint);
  Pose<double> frame = inverse(fork_to_base);
  arm.start = frame;

  // Down to the tip.
  std::vector<std::string> names;
  std::vector<Pose<double>> after(way.size());
  std::size_t last = fork;
  for (std::size_t k = fork; k < way.size(); ++k) {
    const UrdfJointNode& joint = *way[k]->parent_joint;
    const Pose<double> origin = tree.origin(joint);
    frame = frame * origin;
    arm.steps.push_back({joint.name, joint.is_turning(), origin});
    if (joint.is_turning()) {
      if (names.size() < joint_count) {
        UrdfJoint& out = arm.joints[names.size()];
        out.name = joint.name;
        out.origin = frame;
        read_motion(tree, joint, out, arm.warnings);
      }
      names.push_back(joint.name);
      frame = Pose<double>();
      last = k;
    } else if (!joint.is_fixed()) {
      throw tree.error(joint, "a joint that is revolute, continuous or fixed", "one that is " + joint.type);
    }
    after[k] = frame;
  }
  if (names.size() != joint_count) {
    throw tree.error(*tip,
                     fmt::format("exactly six revolute or continuous joints between {} and here", arm.base),
                     names.empty() ? "none" : fmt::format("{}: {}", names.size(), fmt::join(names, ", ")));
  }
  const std::size_t flange = find_flange(tree, way, last, links.flange);
  arm.flange = way[flange]->name;
  arm.flange_steps = flange - last;
  arm.flange_after = after[flange];
  arm.tip_after = after.back();
  return arm;
}

}  // namespace flexcomp::host
