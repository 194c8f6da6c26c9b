// SPDX-License-Identifier: Apache-2.0
#include "measurement/measured_data.hpp"

#include <algorithm>

namespace flexcomp::host {

bool ContextColumns::all_moves() const {
  return std::all_of(move.begin(), move.end(), [](bool b) { return b; });
}

bool ContextColumns::all_directions() const {
  for (std::size_t j = 0; j < joint_count; ++j) {
    if (!move[j] && !direction[j]) return false;
  }
  return true;
}

}  // namespace flexcomp::host
