// SPDX-License-Identifier: Apache-2.0
/// \file
/// A calibration in the words of a URDF: the same file with the origins of its joints put right.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "exchange/urdf_file.hpp"
#include "model/calibration.hpp"
#include "model/robot.hpp"
#include "model/term_set.hpp"

namespace flexcomp::host {

struct CorrectedUrdf {
  struct Joint {
    std::string name;
    double moved_m = 0;  ///< its origin, as seen from the joint before
    double turned_rad = 0;
  };
  std::string text;
  std::vector<Joint> joints;  ///< those whose origins changed
  std::string base;
  std::string tip;         ///< the link that now moves as Ftool
  bool added_tip = false;  ///< it is a new link, for nothing fixed lies between joint 6 and the tip
};

/// The tip of the result moves in the base as B A1 … A6 Tool with all geometric terms, to 1e-9 m and rad, for every q; B is
/// in it where the calibration has it. The URDF may state the robot's frames in its own way: F0 and Ftool may lie
/// anywhere, but the six axes must be those of the robot file.
/// \throws InputError  as load_urdf(); axes that lie otherwise (by more than 1e-6 m or rad, with the joint)
CorrectedUrdf correct_urdf(const std::string& path, const UrdfLinks& links, const Robot& robot,
                           const Calibration& calibration);

/// The geometric terms alone: what a rigid description can hold.
TermSet rigid_part(const TermSet& set);

/// What a rigid description leaves out.
struct LeftOut {
  struct Effect {
    std::string name;
    double largest_m = 0;  ///< of the tool, by this effect alone
    double largest_rad = 0;
  };
  std::vector<Effect> effects;
  double largest_m = 0;  ///< by all together
  double largest_rad = 0;
  std::size_t poses = 0;
};

/// Over random joint readings inside the limits, each with and without the robot file's payload and with joints that came
/// from either side; at reference temperature, at time 0, without external force.
LeftOut left_out_by_rigid(const Calibration& calibration, const Robot& robot, std::size_t poses);

}  // namespace flexcomp::host
