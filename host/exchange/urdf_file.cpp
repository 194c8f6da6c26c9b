// SPDX-License-Identifier: Apache-2.0
#include "exchange/urdf_file.hpp"

#include <console_bridge/console.h>
#include <fmt/format.h>
#include <tinyxml.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <exception>
#include <map>

#include "files/read_file.hpp"
#include "input_error.hpp"
#include "model/frames.hpp"
#include "nearest.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

/// Limits wider than this are a way of writing "none".
constexpr double widest_rad = 20 * pi;

/// Keeps what liburdfdom would print.
class Listener : public console_bridge::OutputHandler {
 public:
  Listener() { console_bridge::useOutputHandler(this); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  ~Listener() override { console_bridge::restorePreviousOutputHandler(); }

  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR) said_.push_back(text);
  }
  std::string said() const { return fmt::format("{}", fmt::join(said_, "; ")); }

 private:
  std::vector<std::string> said_;
};

const char* kind(const urdf::Joint& joint) {
  switch (joint.type) {
    case urdf::Joint::REVOLUTE:
      return "revolute";
    case urdf::Joint::CONTINUOUS:
      return "continuous";
    case urdf::Joint::PRISMATIC:
      return "prismatic";
    case urdf::Joint::FLOATING:
      return "floating";
    case urdf::Joint::PLANAR:
      return "planar";
    case urdf::Joint::FIXED:
      return "fixed";
    default:
      return "of no known type";
  }
}

bool is_turning(const urdf::Joint& joint) {
  return joint.type == urdf::Joint::REVOLUTE || joint.type == urdf::Joint::CONTINUOUS;
}

Eigen::Vector3d vector(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }

Pose<double> pose(const urdf::Pose& p) {
  const urdf::Rotation& q = p.rotation;
  return {Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized().toRotationMatrix(), vector(p.position)};
}

using LinkPtr = urdf::LinkConstSharedPtr;

/// A tree of links that knows its file.
class Tree {
 public:
  explicit Tree(const std::string& path) : path_(path) {
    const std::string text = read_file(path);
    if (text.empty()) throw InputError(path, 0, "", "a file that can be read", "nothing in it");
    // Once for the lines, which liburdfdom does not tell.
    TiXmlDocument xml;
    xml.Parse(text.c_str());
    if (xml.Error()) {
      throw InputError(path, static_cast<std::size_t>(std::max(0, xml.ErrorRow())), "", "XML",
                       xml.ErrorDesc(), ErrorCode::not_xml);
    }
    const TiXmlElement* robot = xml.RootElement();
    if (robot == nullptr || robot->ValueStr() != "robot") {
      throw InputError(path, 1, "", "a URDF, whose first element is <robot>",
                       robot == nullptr ? "no element" : "<" + robot->ValueStr() + ">");
    }
    for (const TiXmlElement* e = robot->FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
      if (e->ValueStr().starts_with("xacro:")) {
        throw InputError(path, static_cast<std::size_t>(std::max(0, e->Row())), "",
                         "a URDF, as xacro writes it out (xacro FILE > FILE.urdf)",
                         "<" + e->ValueStr() + ">");
      }
      const char* name = e->Attribute("name");
      if (name != nullptr)
        line_[e->ValueStr() + " " + name] = static_cast<std::size_t>(std::max(0, e->Row()));
    }
    Listener listener;
    try {
      model_ = urdf::parseURDF(text);
    } catch (const std::exception& e) {
      throw InputError(path, 0, "", "a URDF", e.what());
    }
    if (!model_ || !model_->getRoot()) throw InputError(path, 0, "", "a URDF", listener.said());
  }

  const urdf::ModelInterface& model() const { return *model_; }

  InputError error(const urdf::Joint& joint, const std::string& expected, const std::string& found) const {
    return at("joint", joint.name, expected, found);
  }
  InputError error(const urdf::Link& link, const std::string& expected, const std::string& found) const {
    return at("link", link.name, expected, found);
  }
  InputError error(const std::string& argument, const std::string& expected, const std::string& found) const {
    return {path_, 0, argument, expected, found, ErrorCode::argument};
  }

  /// The link that an argument names.
  LinkPtr link(const std::string& argument, const std::string& name) const {
    const LinkPtr found = model_->getLink(name);
    if (found) return found;
    std::vector<std::string> known;
    for (const auto& entry : model_->links_) known.push_back(entry.first);
    const std::string near = nearest(name, known);
    throw error(argument,
                near.empty() ? fmt::format("one of the links {}", fmt::join(known, ", "))
                             : fmt::format("a link of the file (did you mean '{}'?)", near),
                "'" + name + "'");
  }

 private:
  InputError at(const std::string& what, const std::string& name, const std::string& expected,
                const std::string& found) const {
    const auto line = line_.find(what + " " + name);
    return {path_, line == line_.end() ? 0 : line->second, fmt::format("{} '{}'", what, name), expected,
            found};
  }

  std::string path_;
  std::map<std::string, std::size_t> line_;
  urdf::ModelInterfaceSharedPtr model_;
};

/// From the root down to this link.
std::vector<LinkPtr> ancestry(LinkPtr link) {
  std::vector<LinkPtr> way;
  for (; link; link = link->getParent()) way.push_back(link);
  std::reverse(way.begin(), way.end());
  return way;
}

std::size_t turning_joints(const std::vector<LinkPtr>& way) {
  return static_cast<std::size_t>(std::count_if(way.begin(), way.end(), [](const LinkPtr& link) {
    return link->parent_joint && is_turning(*link->parent_joint);
  }));
}

/// Where links part: the number of links that both ways share.
std::size_t shared(const std::vector<LinkPtr>& a, const std::vector<LinkPtr>& b) {
  const auto [first, second] = std::mismatch(a.begin(), a.end(), b.begin(), b.end());
  return static_cast<std::size_t>(first - a.begin());
}

LinkPtr find_tip(const Tree& tree, const std::vector<LinkPtr>& to_base) {
  std::vector<LinkPtr> tips;
  std::vector<std::string> ends;
  for (const auto& entry : tree.model().links_) {
    const LinkPtr link = entry.second;
    if (!link->child_links.empty()) continue;
    std::vector<LinkPtr> way = ancestry(link);
    way.erase(way.begin(), way.begin() + static_cast<std::ptrdiff_t>(shared(way, to_base)));
    const std::size_t turning = turning_joints(way);
    if (turning == joint_count) tips.push_back(link);
    ends.push_back(fmt::format("{} after {}", link->name, turning));
  }
  if (tips.size() == 1) return tips.front();
  if (tips.empty()) {
    throw tree.error("tip",
                     "a link that is six revolute or continuous joints away from " + to_base.back()->name,
                     fmt::format("ends {}", fmt::join(ends, ", ")));
  }
  std::vector<std::string> names;
  for (const LinkPtr& tip : tips) names.push_back(tip->name);
  throw tree.error("tip", "to be told which of several links to take",
                   fmt::format("{}", fmt::join(names, ", ")));
}

void read_motion(const Tree& tree, const urdf::Joint& from, UrdfJoint& joint,
                 std::vector<std::string>& warnings) {
  if (from.mimic) {
    throw tree.error(from, "a joint that moves by itself",
                     "one that mimics '" + from.mimic->joint_name + "'");
  }
  const Eigen::Vector3d axis = vector(from.axis);
  if (!(axis.norm() > 1e-6)) {
    throw tree.error(from, "an axis with a direction", fmt::format("{} {} {}", axis.x(), axis.y(), axis.z()));
  }
  joint.axis = axis.normalized();
  joint.max_speed_rad_s = from.limits && from.limits->velocity > 0 ? from.limits->velocity : 0;
  const bool bounded = from.type == urdf::Joint::REVOLUTE && from.limits;
  if (bounded && !(from.limits->lower < from.limits->upper)) {
    throw tree.error(from, "a lower limit below the upper one",
                     fmt::format("{} and {} rad", from.limits->lower, from.limits->upper));
  }
  if (bounded && from.limits->lower > -widest_rad && from.limits->upper < widest_rad) {
    joint.limits = {from.limits->lower, from.limits->upper};
  } else {
    warnings.push_back(
        fmt::format("joint '{}' has no limits in the file; taken as +-360 degrees", from.name));
  }
}

/// The flange's place on the way to the tip.
std::size_t find_flange(const Tree& tree, const std::vector<LinkPtr>& way, std::size_t last_joint,
                        const std::string& name) {
  if (!name.empty()) {
    const LinkPtr wanted = tree.link("flange", name);
    const auto at = std::find(way.begin() + static_cast<std::ptrdiff_t>(last_joint), way.end(), wanted);
    if (at == way.end()) {
      throw tree.error("flange", fmt::format("a link from {} to {}", way[last_joint]->name, way.back()->name),
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
  const Tree tree(path);
  UrdfArm arm;
  arm.name = tree.model().getName();
  const std::vector<LinkPtr> to_base =
      ancestry(links.base.empty() ? LinkPtr(tree.model().getRoot()) : tree.link("base", links.base));
  const LinkPtr tip = links.tip.empty() ? find_tip(tree, to_base) : tree.link("tip", links.tip);
  const std::vector<LinkPtr> way = ancestry(tip);
  const std::size_t fork = shared(way, to_base);
  arm.base = to_base.back()->name;
  arm.tip = tip->name;

  // Up from the base to where its way and the tip's part.
  Pose<double> root_to_base;
  for (std::size_t k = 1; k < to_base.size(); ++k) {
    const urdf::Joint& joint = *to_base[k]->parent_joint;
    if (joint.type != urdf::Joint::FIXED && k >= fork) {
      throw tree.error(joint, "fixed joints alone between the base and the arm",
                       std::string("a joint that is ") + kind(joint));
    }
    root_to_base = root_to_base * pose(joint.parent_to_joint_origin_transform);
  }
  arm.down = root_to_base.rotation.transpose() * -Eigen::Vector3d::UnitZ();
  Pose<double> fork_to_base;
  for (std::size_t k = fork; k < to_base.size(); ++k)
    fork_to_base = fork_to_base * pose(to_base[k]->parent_joint->parent_to_joint_origin_transform);
  Pose<double> frame = inverse(fork_to_base);
  arm.start = frame;

  // Down to the tip.
  std::vector<std::string> names;
  std::vector<Pose<double>> after(way.size());
  std::size_t last = fork;
  for (std::size_t k = fork; k < way.size(); ++k) {
    const urdf::Joint& joint = *way[k]->parent_joint;
    frame = frame * pose(joint.parent_to_joint_origin_transform);
    arm.steps.push_back({joint.name, is_turning(joint), pose(joint.parent_to_joint_origin_transform)});
    if (is_turning(joint)) {
      if (names.size() < joint_count) {
        UrdfJoint& out = arm.joints[names.size()];
        out.name = joint.name;
        out.origin = frame;
        read_motion(tree, joint, out, arm.warnings);
      }
      names.push_back(joint.name);
      frame = Pose<double>();
      last = k;
    } else if (joint.type != urdf::Joint::FIXED) {
      throw tree.error(joint, "a joint that is revolute, continuous or fixed",
                       std::string("one that is ") + kind(joint));
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
