// SPDX-License-Identifier: Apache-2.0
/// \file
/// Selects the identifiable parameters of measured rows and suggests poses that identify the others.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "identification/identifiability.hpp"
#include "identification/residuals.hpp"
#include "model/calibration.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// A pose whose measurement identifies a missing parameter.
struct SuggestedPose {
  std::array<double, joint_count> q_rad{};
  double payload_kg = 0;
};

/// A parameter that a second payload would identify better.
struct PayloadGain {
  std::string parameter;
  double sigma = 0;            ///< SI, expected from these rows
  double sigma_with_both = 0;  ///< SI, expected if every second one were measured without the payload
};

struct Identifiability {
  Unknowns fitted;                     ///< identifiable from these rows
  std::vector<Confounded> confounded;  ///< not separable by any rows of this kind
  /// Identifiable from 1,000 random poses of this kind, but not from these rows.
  std::vector<std::string> missing;
  /// Poses that would identify the missing parameters, best first; empty where none is missing.
  std::vector<SuggestedPose> suggested_poses;
  std::vector<PayloadGain> payload_gains;  ///< where all rows have one payload; largest sigma first
};

/// Analyses the identifiability of the unknowns `all` at the estimate `start`, Eq. (M33). Rows "of this kind"
/// measure the same (poses, positions) in the same contexts; where every row is without payload though the
/// robot file has one, half of them have it. Missing parameters that have a tolerance stay in `fitted`: the
/// tolerance is their prior.
Identifiability analyse_identifiability(const Robot& robot, const std::vector<Observation>& rows,
                                        const Estimate& start, const Unknowns& all, std::uint64_t seed);

/// Columns of the identification matrix that 1,000 random rows of this kind separate, by index into `all` (frames
/// first), and the confounded ones. Depends on the arm and the kind of measurement only.
Elimination possible_columns(const Robot& robot, const std::vector<Observation>& like, const Estimate& start,
                             const Unknowns& all, std::uint64_t seed);

}  // namespace flexcomp::host
