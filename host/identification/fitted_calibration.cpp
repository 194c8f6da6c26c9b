// SPDX-License-Identifier: Apache-2.0
#include "identification/fitted_calibration.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "identification/covariance_factor.hpp"

namespace flexcomp::host {

namespace {

/// Copies fitted and given terms with their standard deviations; others (coefficient zero) are left out.
void copy_identified_terms(Calibration& calibration, const TermSet& set, const Unknowns& fitted,
                           const Eigen::VectorXd& sigma) {
  std::vector<double> of_term(set.terms.size(), std::nan(""));
  std::vector<double> of_value(set.values.size(), std::nan(""));
  std::vector<bool> kept(set.terms.size(), false);
  for (std::size_t t = 0; t < set.terms.size(); ++t) {
    kept[t] = set.terms[t].coefficient != 0;  // fixed by the user: no uncertainty
  }
  for (std::size_t p = 0; p < fitted.parameters.size(); ++p) {
    const double s = sigma[static_cast<Eigen::Index>(fitted.frames.size() + p)];
    if (fitted.parameters[p].value) of_value[*fitted.parameters[p].value] = s;
    for (const std::size_t t : fitted.parameters[p].terms) {
      if (!fitted.parameters[p].value) of_term[t] = s;
      kept[t] = true;
    }
  }
  calibration.terms.tables = set.tables;
  calibration.terms.values = set.values;
  calibration.value_sigma = of_value;
  for (std::size_t t = 0; t < set.terms.size(); ++t) {
    if (!kept[t]) continue;
    calibration.terms.terms.push_back(set.terms[t]);
    calibration.sigma.push_back(of_term[t]);
  }
}

}  // namespace

Calibration fitted_calibration(const Fit& fit, const Unknowns& fitted, const Robot& robot,
                               const std::vector<Observation>& rows) {
  Calibration out;
  const Eigen::VectorXd units = units_of(fitted, fit.estimate.set);
  const Eigen::VectorXd sigma = fit.covariance.diagonal().cwiseMax(0).cwiseSqrt().cwiseProduct(units);
  copy_identified_terms(out, fit.estimate.set, fitted, sigma);
  out.covariance = covariance_factor(fit, fitted, robot, rows);
  if (!fitted.frames.empty())
    out.frames = MeasurementFrames{Frame::of(fit.estimate.f), Frame::of(fit.estimate.e)};
  for (std::size_t p = 0; p < fitted.parameters.size(); ++p) {
    if (fit.at_bound[p]) out.at_bound.push_back({fitted.parameters[p].name, fit.interval[p].high});
  }
  stamp(out, robot);
  return out;
}

Estimate estimate_of(const Calibration& calibration) {
  return {calibration.terms, calibration.f(), calibration.e()};
}

}  // namespace flexcomp::host
