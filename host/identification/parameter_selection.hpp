// SPDX-License-Identifier: Apache-2.0
/// \file
/// What rows of a kind can know, what these rows know of it, and which poses would tell the rest.
#ifndef FLEXCOMP_HOST_IDENTIFICATION_PARAMETER_SELECTION_HPP
#define FLEXCOMP_HOST_IDENTIFICATION_PARAMETER_SELECTION_HPP

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "identification/identifiability.hpp"
#include "identification/residuals.hpp"
#include "model/calibration.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// A pose worth measuring.
struct SuggestedPose {
  std::array<double, joint_count> q_rad{};
  double payload_kg = 0;
};

/// A parameter that other payloads would make known better.
struct PayloadGain {
  std::string parameter;
  double sigma = 0;            ///< SI, expected from these rows
  double sigma_with_both = 0;  ///< SI, expected if every second one were measured without the payload
};

struct Identifiability {
  Unknowns fitted;                     ///< what these rows know
  std::vector<Confounded> confounded;  ///< cannot be told apart by any rows of this kind
  std::vector<std::string> missing;    ///< known to 1,000 random poses of this kind, but not to these rows
  /// Poses that would make the missing ones known, best first; empty where nothing is missing.
  std::vector<SuggestedPose> cure;
  std::vector<PayloadGain> payload_gains;  ///< where all rows have one payload; worst known first
};

/// Judges the columns of `all` at `start`. Rows "of this kind" measure the same (poses, positions) in the same contexts;
/// where every row is without payload though the robot file has one, half of them have it.
/// Missing parameters that have a tolerance stay in `fitted`: the tolerance holds them.
Identifiability analyse_identifiability(const Robot& robot, const std::vector<Observation>& rows,
                                        const Estimate& start, const Unknowns& all, std::uint64_t seed);

/// Columns of the identification matrix that 1,000 random rows like these tell apart, by index into `all` (frames
/// first), and those that are lost with what carries them. A property of the arm and the kind of measurement.
Elimination possible_columns(const Robot& robot, const std::vector<Observation>& like, const Estimate& start,
                             const Unknowns& all, std::uint64_t seed);

}  // namespace flexcomp::host

#endif
