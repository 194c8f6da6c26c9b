// SPDX-License-Identifier: Apache-2.0
#include "identification/fitted_parameters.hpp"

#include <algorithm>
#include <cmath>

namespace flexcomp::host {

std::vector<FittedParameter> fitted_parameters(const Identification& r) {
  std::vector<FittedParameter> rows;
  const Unknowns& fitted = r.identifiability.fitted;
  const Eigen::VectorXd units = units_of(fitted, r.fit.estimate.set);
  for (std::size_t p = 0; p < fitted.parameters.size(); ++p) {
    const Parameter& parameter = fitted.parameters[p];
    const double unit = parameter.si_per_file_unit();
    const Eigen::Index i = static_cast<Eigen::Index>(fitted.frames.size() + p);
    rows.push_back({parameter.name, parameter.get(r.fit.estimate.set) / unit,
                    std::sqrt(std::max(0.0, r.fit.covariance(i, i))) * units[i] / unit,
                    r.fit.interval[p].low / unit, r.fit.interval[p].high / unit, r.fit.at_bound[p]});
  }
  return rows;
}

}  // namespace flexcomp::host
