// SPDX-License-Identifier: Apache-2.0
/// \file
/// Variance components of places (D15): places that move from pose to pose and follow nothing that was recorded, as play
/// without its direction, joints that were read too early, a loose screw.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_SCATTER_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_SCATTER_HPP

#include <vector>

#include "diagnosis/fitted_model.hpp"
#include "identification/estimator.hpp"
#include "measurement/observation.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// A place whose value is drawn from a normal distribution at every pose.
struct Scatter {
  Place place;
  double sigma = 0;  ///< rad or m
  /// 2 ln of the likelihood ratio against no scatter here.
  double gain = 0;
};

/// A model whose noise is the declared one plus the scatter of these places.
struct ScatteredModel {
  std::vector<Scatter> places;    ///< largest gain first; empty: nothing scatters
  std::vector<Observation> rows;  ///< with the wider noise in their whitening
  double log_determinant = 0;     ///< of the wider noise over the declared one, all rows
  Fit fit;                        ///< to these rows
};

/// Maximum likelihood, place after place, in turns with the parameters. Down-weighted rows do not count for the scatter.
ScatteredModel scattered_model(const Robot& robot, const std::vector<Observation>& rows,
                               const FittedModel& start);

}  // namespace flexcomp::host

#endif
