// SPDX-License-Identifier: Apache-2.0
/// \file
/// The text of a URDF with some numbers changed and every other byte as it was: comments, meshes, order and blanks are the
/// user's.
#ifndef FLEXCOMP_HOST_EXCHANGE_URDF_TEXT_HPP
#define FLEXCOMP_HOST_EXCHANGE_URDF_TEXT_HPP

#include <map>
#include <string>

#include "flexcomp/linear.hpp"

namespace flexcomp::host {

/// Puts xyz and rpy of these joints' origins; a joint without <origin> gets one. To 1e-15 m and rad. \throws std::invalid_argument  a joint that the text does not have under <robot>
std::string with_origins(const std::string& text, const std::map<std::string, Pose<double>>& origins);

/// The text with a link added before its end that hangs on `parent` by a fixed joint.
std::string with_fixed_link(const std::string& text, const std::string& parent, const std::string& link,
                            const Pose<double>& origin);

/// Rot(z,yaw) Rot(y,pitch) Rot(x,roll); exact to rounding also where pitch is 90 degrees and only a sum is defined.
Eigen::Vector3d roll_pitch_yaw(const Eigen::Matrix3d& rotation);

}  // namespace flexcomp::host

#endif
