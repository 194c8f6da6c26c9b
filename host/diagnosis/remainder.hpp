// SPDX-License-Identifier: Apache-2.0
/// \file
/// Remainder: what no name explains is carried by curves of all joints (D19, D20). Names are judged again beside them, and
/// only those stay that the rows support there.
#pragma once

#include <optional>

#include "diagnosis/effect_search.hpp"
#include "diagnosis/joint_curves.hpp"

namespace flexcomp::host {

/// Curves that carry what the selection leaves over, at the maximum of their marginal likelihood; nothing where they gain no
/// more than a name must, or predict left-out poses no better (D12). Removes from the selection what is not sure beside
/// them, and refits it with them. A joint's curve keeps its name where the search named one and it is sure.
std::optional<Remainder> carry_remainder(Selection& selection, const Robot& robot,
                                         const std::vector<Observation>& rows, const LeftOutPoses& left_out);

}  // namespace flexcomp::host
