// SPDX-License-Identifier: Apache-2.0
#include "distributions.hpp"

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>

namespace flexcomp::host {

double normal_above(double x) { return boost::math::cdf(boost::math::complement(boost::math::normal(), x)); }

double normal_upper_quantile(double probability) {
  return boost::math::quantile(boost::math::complement(boost::math::normal(), probability));
}

double chi2_quantile(double probability, double degrees_of_freedom) {
  return boost::math::quantile(boost::math::chi_squared(degrees_of_freedom), probability);
}

double chi2_above(double chi2, double degrees_of_freedom) {
  return boost::math::cdf(boost::math::complement(boost::math::chi_squared(degrees_of_freedom), chi2));
}

double fisher_f_above(double f, double numerator_dof, double denominator_dof) {
  return boost::math::cdf(boost::math::complement(boost::math::fisher_f(numerator_dof, denominator_dof), f));
}

}  // namespace flexcomp::host
