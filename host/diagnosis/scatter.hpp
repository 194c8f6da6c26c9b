// SPDX-License-Identifier: Apache-2.0
/// \file
/// Places of the chain that move from pose to pose and follow nothing that was recorded: play whose direction nobody wrote
/// down, joints that were read too early, a screw that is loose.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_SCATTER_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_SCATTER_HPP

#include <vector>

#include "identification/estimator.hpp"
#include "measurement/observation.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// A place that takes another value at every pose, as if drawn from a normal distribution.
struct Scatter {
  Place place;
  double sigma = 0;  ///< rad or m
  /// 2 ln of the likelihood ratio against no scatter here.
  double gain = 0;
};

/// A model whose noise is the declared one and the scatter of these places besides.
struct ScatteredModel {
  std::vector<Scatter> places;    ///< largest gain first; empty: nothing scatters
  std::vector<Observation> rows;  ///< with the wider noise in their whitening
  double log_determinant = 0;     ///< of the wider noise over the declared one, all rows
  Fit fit;                        ///< to these rows
};

/// Maximum likelihood, place after place, in turns with the parameters.
/// \param fitted  what the rows move, beginning at `start`; rows of `weight` below 1 do not speak of the scatter
ScatteredModel scattered_model(const Robot& robot, const std::vector<Observation>& rows,
                               const Estimate& start, const Unknowns& fitted,
                               const std::vector<double>& weight);

}  // namespace flexcomp::host

#endif
