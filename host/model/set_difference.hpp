// SPDX-License-Identifier: Apache-2.0
/// \file
/// What would change at the arm if one set of parameters took the place of another: by name, and at the tool.
#ifndef FLEXCOMP_HOST_MODEL_SET_DIFFERENCE_HPP
#define FLEXCOMP_HOST_MODEL_SET_DIFFERENCE_HPP

#include <cstddef>
#include <string>
#include <vector>

#include "model/robot.hpp"
#include "model/term_set.hpp"
#include "units.hpp"

namespace flexcomp::host {

struct ToolShift {
  double largest_m = 0;
  double mean_m = 0;
  double largest_rad = 0;
};

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

}  // namespace flexcomp::host

#endif
