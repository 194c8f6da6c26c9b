// SPDX-License-Identifier: Apache-2.0
/// \file
/// An effect as a curve, and what the rows say of it: the numbers behind its drawing.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "measurement/observation.hpp"
#include "model/calibration.hpp"
#include "model/effects.hpp"

namespace flexcomp::host {

struct ProfilePoint {
  double x = 0;          ///< of EffectProfile::x_name
  double value_rad = 0;  ///< by which the effect turns its joint
  double sigma_rad =
      0;  ///< of its shape about its mean, from the calibration's covariance; 0 where it has none
};

/// What one row says of the joint's turn, carried back from the tool: weighted least squares on the joint's screw.
struct ProfileRow {
  double x = 0;
  double without_rad = 0;  ///< with everything else of the model in place, this effect taken out
  double left_rad = 0;     ///< with it
  double sigma_rad = 0;    ///< of both, by the noise of the row
};

struct EffectProfile {
  std::string x_name;  ///< with its unit
  bool cases = false;  ///< x is -1, 0 or 1
  std::vector<ProfilePoint> line;
  std::vector<ProfileRow> rows;
};

/// Of an effect that turns one joint and follows one quantity; nothing where it is of another kind, or not in the
/// calibration.
std::optional<EffectProfile> profile_of(const Robot& robot, const Calibration& calibration,
                                        const EffectId& id, const std::vector<Observation>& rows);

}  // namespace flexcomp::host
