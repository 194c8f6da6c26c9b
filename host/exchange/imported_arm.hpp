// SPDX-License-Identifier: Apache-2.0
/// \file
/// Robots from other files than ours.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "exchange/urdf_file.hpp"
#include "files/robot_file.hpp"
#include "flexcomp/linear.hpp"

namespace flexcomp::host {

/// base_to_f0 · (the robot's forward kinematics) is the tip in the base, as the source has it, for every q.
struct ImportedArm {
  Robot robot;
  Pose<double> base_to_f0;
  bool f0_is_base = true;
  std::string base;  ///< links of the source; empty where it is a robot file
  std::string flange;
  std::string tip;
  std::array<std::string, joint_count> joints;
  std::vector<std::string> warnings;
};

/// A URDF. Gravity points along -z of its root link. The robot gets no payload, noise or bodies: a URDF has none that
/// would do. \throws InputError  as load_urdf()
ImportedArm import_urdf(const std::string& path, const UrdfLinks& links);

/// A robot file, with its links put as links_of() puts them: for tables in which near-parallel axes drove d to hundreds
/// of metres. F0, tool point, readings and all else stay; payload and bodies are carried into the new frames.
/// \throws InputError  as load_robot(), but for long links
ImportedArm import_robot(const std::string& path);

}  // namespace flexcomp::host
