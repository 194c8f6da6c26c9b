// SPDX-License-Identifier: Apache-2.0
/// \file
/// The fitted parameters of an identification in the units of files.
#ifndef FLEXCOMP_HOST_IDENTIFICATION_FITTED_PARAMETERS_HPP
#define FLEXCOMP_HOST_IDENTIFICATION_FITTED_PARAMETERS_HPP

#include <string>
#include <vector>

#include "identification/identify.hpp"

namespace flexcomp::host {

/// What is said of one fitted parameter, in the unit of files.
struct FittedParameter {
  std::string name;
  double value = 0;
  double sigma = 0;
  double low = 0;
  double high = 0;
  bool at_bound = false;
  /// Different from the nominal arm beyond chance: zero lies outside the 95 % interval.
  bool significant() const { return low > 0 || high < 0; }
};

std::vector<FittedParameter> fitted_parameters(const Identification& r);

}  // namespace flexcomp::host

#endif
