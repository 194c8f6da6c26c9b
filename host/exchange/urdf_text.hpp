// SPDX-License-Identifier: Apache-2.0
/// \file
/// The text of a URDF with the origins of some joints replaced and every other byte as it was: comments, meshes, order and
/// blanks are the user's.
#ifndef FLEXCOMP_HOST_EXCHANGE_URDF_TEXT_HPP
#define FLEXCOMP_HOST_EXCHANGE_URDF_TEXT_HPP

#include <map>
#include <optional>
#include <string>

#include "flexcomp/linear.hpp"

namespace flexcomp::host {

/// A link to be added before the end of the robot, on a fixed joint.
struct AddedLink {
  std::string parent;
  std::string suffix;  ///< its name is the parent's with this behind
  Pose<double> origin;
};

/// Sets xyz and rpy of these joints' origins, rounded to 1e-15 m and rad; a joint without <origin> gets one.
/// \throws InputError  as parse_xml()
/// \throws std::invalid_argument  a joint or link that the text does not have under <robot>, or has twice
std::string with_origins(const std::string& path, const std::string& text,
                         const std::map<std::string, Pose<double>>& origins,
                         const std::optional<AddedLink>& added);

}  // namespace flexcomp::host

#endif
