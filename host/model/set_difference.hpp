// SPDX-License-Identifier: Apache-2.0
/// \file
/// What would change at the arm if one set of parameters took the place of another: by name, and at the tool.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "flexcomp/linear.hpp"
#include "flexcomp/robot.hpp"
#include "json.hpp"
#include "model/robot.hpp"
#include "model/term_set.hpp"
#include "units.hpp"

namespace flexcomp::host {

struct ToolShift {
  double largest_m = 0;
  double mean_m = 0;
  double largest_rad = 0;
};

/// Joint readings inside the limits, at which each joint came from one side or the other; else the default context.
struct RandomPlace {
  std::array<double, joint_count> q_rad{};
  Context<double, joint_count> context;
};
/// The same in every run.
std::vector<RandomPlace> random_places(const Robot& robot, std::size_t count);

/// Ftool in F0. `source` is named in the message. \throws InputError  terms that the core refuses
std::vector<Pose<double>> poses_of(const TermSet& set, const Robot& robot, const std::vector<RandomPlace>& at,
                                   const std::string& source = "");

/// From the poses of one set of terms to those of another.
ToolShift tool_shift(const std::vector<Pose<double>>& from, const std::vector<Pose<double>>& to);

struct ParameterChange {
  std::string name;
  Unit unit;
  double before = 0;  ///< SI; 0 where the set before did not have it
  double after = 0;   ///< SI; 0 where the new set does not have it
  ToolShift at_tool;  ///< by this parameter alone
};

struct SetDifference {
  std::vector<ParameterChange> changes;  ///< in the order of the new set, then what went
  std::size_t unchanged = 0;
  ToolShift at_tool;  ///< by all of them
  std::size_t poses = 0;
};

/// Over `poses` random joint readings inside the limits, the same in every run, with the robot file's payload and with
/// joints that came from either side.
/// \throws std::invalid_argument  terms that the catalogue cannot name
SetDifference difference(const TermSet& before, const TermSet& after, const Robot& robot, std::size_t poses);

/// {"unchanged", "tool": {…}, "parameters": […]}, in the units of files.
Json to_json(const SetDifference& d);

}  // namespace flexcomp::host
