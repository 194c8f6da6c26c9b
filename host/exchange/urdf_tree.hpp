// SPDX-License-Identifier: Apache-2.0
/// \file
/// The links and joints of a URDF as a tree that knows its file and lines.
#ifndef FLEXCOMP_HOST_EXCHANGE_URDF_TREE_HPP
#define FLEXCOMP_HOST_EXCHANGE_URDF_TREE_HPP

#include <fmt/format.h>

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "exchange/xml.hpp"
#include "flexcomp/linear.hpp"
#include "input_error.hpp"

namespace flexcomp::host {

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

/// Each link but one, the root, hangs on one joint. Numbers of a joint are parsed when they are asked for: what is wrong
/// with a gripper is no reason to refuse the arm.
class UrdfTree {
 public:
  /// \throws InputError  file absent; as parse_xml(); no URDF; links that are no tree
  explicit UrdfTree(const std::string& path);

  std::string name() const { return robot_.attribute("name")->value; }
  const UrdfLinkNode* root() const { return root_; }
  const std::map<std::string, UrdfLinkNode>& links() const { return links_; }
  /// The link that an argument names. \throws InputError  none, with the nearest name
  const UrdfLinkNode* link(const std::string& argument, const std::string& name) const;

  /// From the parent's frame to the joint's; 1 where the file has none. \throws InputError  other than three numbers
  Pose<double> origin(const UrdfJointNode& joint) const;
  /// Of norm 1. \throws InputError  no direction, or other than three numbers
  Eigen::Vector3d axis(const UrdfJointNode& joint) const;
  /// An attribute of the joint's <limit>; nothing where it is not there. \throws InputError  no number
  std::optional<double> limit(const UrdfJointNode& joint, const char* attribute) const;

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
                          const char* expected) const;
  template <class Node>
  void add(std::map<std::string, Node>& all, const XmlElement& element) const;
  UrdfLinkNode& end(const UrdfJointNode& joint, const char* which);
  void connect(UrdfJointNode& joint);
  void find_root();
  std::optional<Eigen::Vector3d> triple(const UrdfJointNode& joint, const char* element,
                                        const char* attribute) const;

  std::string path_;
  XmlElement robot_;
  std::map<std::string, UrdfLinkNode> links_;
  std::map<std::string, UrdfJointNode> joints_;
  const UrdfLinkNode* root_ = nullptr;
};

/// 'value', or "nothing" where there is none: for messages.
std::string text_of(const XmlAttribute* attribute);

}  // namespace flexcomp::host

#endif
