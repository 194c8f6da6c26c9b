// SPDX-License-Identifier: Apache-2.0
/// \file
/// Priors of parameters: physical bounds and tolerances.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <vector>

#include "model/term_set.hpp"
#include "model/tolerance.hpp"

namespace flexcomp::host {

/// Prior of one parameter, SI: normal around `expected`, bounded below, Eq. (M34), (M37).
struct PriorKnowledge {
  double least = -std::numeric_limits<double>::infinity();  ///< physical lower bound: 0 for a compliance
  double expected = 0;
  double tolerance = std::numeric_limits<double>::infinity();  ///< standard deviation around `expected`
};

/// Common prior of consecutive parameters: normal around 0.
struct GroupPrior {
  std::size_t first = 0;      ///< parameter
  Eigen::MatrixXd precision;  ///< inverse of their covariance, SI
};

/// Priors of the parameters, one each. \param physical a joint deflects in the direction of the torque:
/// compliances are 0 or more
/// \throws InputError  a tolerance that matches no parameter; of two that match one the later applies
std::vector<PriorKnowledge> prior_knowledge(const TermSet& set, const std::vector<Parameter>& parameters,
                                            bool physical, const std::vector<Tolerance>& tolerances);

}  // namespace flexcomp::host
