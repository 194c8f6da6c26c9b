// SPDX-License-Identifier: Apache-2.0
#include "measurement/measured_data.hpp"

#include <algorithm>

namespace flexcomp::host {

bool ContextColumns::all_moves() const {
  return std::all_of(move.begin(), move.end(), [](bool b) { return b; });
}

}  // namespace flexcomp::host
