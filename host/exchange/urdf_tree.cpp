// SPDX-License-Identifier: Apache-2.0
#include "exchange/urdf_tree.hpp"

#include <set>
#include <sstream>

#include "exchange/rotation_angles.hpp"
#include "files/read_file.hpp"
#include "nearest.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

XmlElement parse(const std::string& path) {
  const std::string text = read_file(path);
  if (text.empty()) throw InputError(path, 0, "", "a file that can be read", "nothing in it");
  return parse_xml(path, text);
}

const XmlAttribute* attribute_of(const UrdfJointNode& joint, const char* element, const char* attribute) {
  const XmlElement* const e = joint.element->child(element);
  return e == nullptr ? nullptr : e->attribute(attribute);
}

}  // namespace

std::string text_of(const XmlAttribute* attribute) {
  return attribute == nullptr ? "nothing" : "'" + attribute->value + "'";
}

UrdfTree::UrdfTree(const std::string& path) : path_(path), robot_(parse(path)) {
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

template <class Node>
void UrdfTree::add(std::map<std::string, Node>& all, const XmlElement& element) const {
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

UrdfLinkNode& UrdfTree::end(const UrdfJointNode& joint, const char* which) {
  const XmlAttribute* const name = attribute_of(joint, which, "link");
  const auto link = name == nullptr ? links_.end() : links_.find(name->value);
  if (link != links_.end()) return link->second;
  throw error(joint, fmt::format("a link of the URDF as its {}", which), text_of(name));
}

void UrdfTree::connect(UrdfJointNode& joint) {
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

void UrdfTree::find_root() {
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

const UrdfLinkNode* UrdfTree::link(const std::string& argument, const std::string& name) const {
  if (const auto found = links_.find(name); found != links_.end()) return &found->second;
  std::vector<std::string> known;
  for (const auto& entry : links_) known.push_back(entry.first);
  const std::string near = nearest(name, known);
  throw argument_error(argument,
                       near.empty() ? fmt::format("one of the links {}", fmt::join(known, ", "))
                                    : fmt::format("a link of the file (did you mean '{}'?)", near),
                       "'" + name + "'");
}

InputError UrdfTree::number_error(const UrdfJointNode& joint, const XmlElement& element,
                                  const char* attribute, const char* expected) const {
  return at(element, fmt::format("joint '{}'", joint.name),
            fmt::format("{} as {} of a URDF's <{}>", expected, attribute, element.name),
            text_of(element.attribute(attribute)));
}

std::optional<Eigen::Vector3d> UrdfTree::triple(const UrdfJointNode& joint, const char* element,
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

Pose<double> UrdfTree::origin(const UrdfJointNode& joint) const {
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  const Eigen::Vector3d rpy = triple(joint, "origin", "rpy").value_or(zero);
  return {rotation(AngleConvention::fixed_xyz, rpy).toRotationMatrix(),
          triple(joint, "origin", "xyz").value_or(zero)};
}

Eigen::Vector3d UrdfTree::axis(const UrdfJointNode& joint) const {
  if (joint.element->child("axis") == nullptr) return Eigen::Vector3d::UnitX();
  const Eigen::Vector3d axis = triple(joint, "axis", "xyz").value_or(Eigen::Vector3d::Zero());
  if (axis.norm() > 1e-6) return axis.normalized();
  throw error(joint, "an axis with a direction", fmt::format("{} {} {}", axis.x(), axis.y(), axis.z()));
}

std::optional<double> UrdfTree::limit(const UrdfJointNode& joint, const char* attribute) const {
  const XmlAttribute* const written = attribute_of(joint, "limit", attribute);
  if (written == nullptr) return {};
  if (const auto value = parse_si(written->value, unit::si)) return value;
  throw number_error(joint, *joint.element->child("limit"), attribute, "a finite number");
}

}  // namespace flexcomp::host
