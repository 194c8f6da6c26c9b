// SPDX-License-Identifier: Apache-2.0
#include "exchange/urdf_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <sstream>

#include "exchange/rotation_angles.hpp"
#include "exchange/xml.hpp"
#include "files/read_file.hpp"
#include "input_error.hpp"
#include "model/frames.hpp"
#include "nearest.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

// --- links and joints as a tree that knows its file and lines
// --------------------------------------------------------

struct UrdfLinkNode;

struct UrdfJointNode {
  std::string name;
  std::string type;  ///< revolute, continuous, prismatic, floating, planar or fixed
  const XmlElement* element = nullptr;
  const UrdfLinkNode* parent = nullptr;

  bool is_turning() const { return type == "revolute" || type == "continuous"; }
  bool is_fixed() const { return type == "fixed"; }
};

struct UrdfLinkNode {
  std::string name;
  const XmlElement* element = nullptr;
  const UrdfJointNode* parent_joint = nullptr;  ///< null for the root
  std::vector<const UrdfLinkNode*> children;
};

/// 'value', or "nothing" where there is none: for messages.
std::string text_of(const XmlAttribute* attribute) {
  return attribute == nullptr ? "nothing" : "'" + attribute->value + "'";
}

XmlElement parse(const std::string& path) {
  const std::string text = read_file(path);
  if (text.empty()) throw InputError(path, 0, "", "a file that can be read", "nothing in it");
  return parse_xml(path, text);
}

const XmlAttribute* attribute_of(const UrdfJointNode& joint, const char* element, const char* attribute) {
  const XmlElement* const e = joint.element->child(element);
  return e == nullptr ? nullptr : e->attribute(attribute);
}

/// Each link but one, the root, hangs on one joint. Numbers of a joint are
/// parsed when they are asked for: what is wrong with a gripper is no reason to
/// refuse the arm.
class UrdfTree {
 public:
  /// \throws InputError  file absent; as parse_xml(); no URDF; links that are
  /// no tree
  explicit UrdfTree(const std::string& path) : path_(path), robot_(parse(path)) {
    if (robot_.name != "robot")
      throw at(robot_, "", "a URDF, whose first element is <robot>", "<" + robot_.name + ">");
    if (robot_.attribute("name") == nullptr) throw at(robot_, "", "a URDF, whose <robot> has a name", "none");
    for (const XmlElement& e : robot_.children) {
      if (e.name.starts_with("xacro:"))
        throw at(e, "", "a URDF, as xacro writes it out (xacro FILE > FILE.urdf)", "<" + e.name + ">");
      if (e.name == "link") add(links_, e);
      if (e.name == "joint") add(joints_, e);
    }
    if (links_.empty()) throw at(robot_, "", "a URDF with links", "none");
    for (auto& entry : joints_) connect(entry.second);
    find_root();
  }

  std::string name() const { return robot_.attribute("name")->value; }
  const UrdfLinkNode* root() const { return root_; }
  const std::map<std::string, UrdfLinkNode>& links() const { return links_; }
  /// The link that an argument names. \throws InputError  none, with the
  /// nearest name
  const UrdfLinkNode* link(const std::string& argument, const std::string& name) const {
    if (const auto found = links_.find(name); found != links_.end()) return &found->second;
    std::vector<std::string> known;
    for (const auto& entry : links_) known.push_back(entry.first);
    throw argument_error(argument, expected_name(name, known, "one of the links", "a link of the file"),
                         "'" + name + "'");
  }

  /// From the parent's frame to the joint's; 1 where the file has none. \throws
  /// InputError  other than three numbers
  Pose<double> origin(const UrdfJointNode& joint) const {
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
    const Eigen::Vector3d rpy = triple(joint, "origin", "rpy").value_or(zero);
    return {rotation(AngleConvention::fixed_xyz, rpy).toRotationMatrix(),
            triple(joint, "origin", "xyz").value_or(zero)};
  }

  /// Of norm 1. \throws InputError  no direction, or other than three numbers
  Eigen::Vector3d axis(const UrdfJointNode& joint) const {
    if (joint.element->child("axis") == nullptr) return Eigen::Vector3d::UnitX();
    const Eigen::Vector3d axis = triple(joint, "axis", "xyz").value_or(Eigen::Vector3d::Zero());
    // Of numbers whose squares are beyond the range normalized() makes 0.
    if (axis.norm() > 1e-6) return std::isfinite(axis.norm()) ? axis.normalized() : axis.stableNormalized();
    throw error(joint, "an axis with a direction", fmt::format("{} {} {}", axis.x(), axis.y(), axis.z()));
  }

  /// An attribute of the joint's <limit>; nothing where it is not there.
  /// \throws InputError  no number
  std::optional<double> limit(const UrdfJointNode& joint, const char* attribute) const {
    const XmlAttribute* const written = attribute_of(joint, "limit", attribute);
    if (written == nullptr) return {};
    if (const auto value = parse_si(written->value, unit::si)) return value;
    throw number_error(joint, *joint.element->child("limit"), attribute, "a finite number");
  }

  /// In the line of a link or joint.
  template <class Node>
  InputError error(const Node& node, const std::string& expected, const std::string& found) const {
    return at(*node.element, fmt::format("{} '{}'", node.element->name, node.name), expected, found);
  }
  InputError argument_error(const std::string& argument, const std::string& expected,
                            const std::string& found) const {
    return {path_, 0, argument, expected, found, ErrorCode::argument};
  }

 private:
  InputError at(const XmlElement& element, const std::string& field, const std::string& expected,
                const std::string& found) const {
    return {path_, element.line, field, expected, found};
  }

  InputError number_error(const UrdfJointNode& joint, const XmlElement& element, const char* attribute,
                          const char* expected) const {
    return at(element, fmt::format("joint '{}'", joint.name),
              fmt::format("{} as {} of a URDF's <{}>", expected, attribute, element.name),
              text_of(element.attribute(attribute)));
  }

  template <class Node>
  void add(std::map<std::string, Node>& all, const XmlElement& element) const {
    const XmlAttribute* const name = element.attribute("name");
    if (name == nullptr)
      throw at(element, "", fmt::format("a URDF whose <{}> has a name", element.name), "none");
    const auto [entry, is_new] = all.try_emplace(name->value);
    if (!is_new)
      throw at(element, "", fmt::format("a URDF with each {} once", element.name),
               "'" + name->value + "' again");
    entry->second.name = name->value;
    entry->second.element = &element;
  }

  UrdfLinkNode& end(const UrdfJointNode& joint, const char* which) {
    const XmlAttribute* const name = attribute_of(joint, which, "link");
    const auto link = name == nullptr ? links_.end() : links_.find(name->value);
    if (link != links_.end()) return link->second;
    throw error(joint, fmt::format("a link of the URDF as its {}", which), text_of(name));
  }

  void connect(UrdfJointNode& joint) {
    static const std::set<std::string> types{"revolute", "continuous", "prismatic",
                                             "floating", "planar",     "fixed"};
    const XmlAttribute* const type = joint.element->attribute("type");
    if (type == nullptr || !types.contains(type->value))
      throw error(joint, fmt::format("one of a URDF's types {}", fmt::join(types, ", ")), text_of(type));
    joint.type = type->value;
    UrdfLinkNode& parent = end(joint, "parent");
    UrdfLinkNode& child = end(joint, "child");
    if (child.parent_joint != nullptr) {
      throw error(joint, "a URDF in which each link hangs on one joint",
                  fmt::format("'{}' on '{}' as well", child.name, child.parent_joint->name));
    }
    joint.parent = &parent;
    child.parent_joint = &joint;
    parent.children.push_back(&child);
  }

  void find_root() {
    for (const auto& [name, link] : links_) {
      if (link.parent_joint != nullptr) continue;
      if (root_ != nullptr)
        throw error(link, "a URDF with one root link", fmt::format("'{}' as well", root_->name));
      root_ = &link;
    }
    std::set<const UrdfLinkNode*> below;
    std::vector<const UrdfLinkNode*> next;
    if (root_ != nullptr) next = {root_};
    while (!next.empty()) {
      const UrdfLinkNode* const link = next.back();
      next.pop_back();
      below.insert(link);
      next.insert(next.end(), link->children.begin(), link->children.end());
    }
    for (const auto& [name, link] : links_) {
      if (!below.contains(&link)) throw error(link, "a URDF whose links are a tree", "a ring of joints");
    }
  }

  std::optional<Eigen::Vector3d> triple(const UrdfJointNode& joint, const char* element,
                                        const char* attribute) const {
    const XmlAttribute* const written = attribute_of(joint, element, attribute);
    if (written == nullptr) return {};
    std::istringstream words(written->value);
    std::vector<double> values;
    for (std::string word; words >> word && values.size() < 4;) {
      const auto value = parse_si(word, unit::si);
      if (!value) break;
      values.push_back(*value);
    }
    if (words || values.size() != 3)
      throw number_error(joint, *joint.element->child(element), attribute, "three finite numbers");
    return Eigen::Vector3d(values[0], values[1], values[2]);
  }

  std::string path_;
  XmlElement robot_;
  std::map<std::string, UrdfLinkNode> links_;
  std::map<std::string, UrdfJointNode> joints_;
  const UrdfLinkNode* root_ = nullptr;
};

// --- the arm in it
// ---------------------------------------------------------------------------------------------------

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
  names.reserve(tips.size());
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
