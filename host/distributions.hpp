// SPDX-License-Identifier: Apache-2.0
/// \file
/// Quantiles and tail probabilities of the distributions that decisions here rest on. Behind plain functions, because
/// Boost.Math costs every source that includes it ten seconds to compile.
#pragma once

namespace flexcomp::host {

/// P(X > x), X normally distributed with mean 0 and variance 1.
double normal_above(double x);
/// x with P(X > x) = probability, X as above.
double normal_upper_quantile(double probability);

/// x with P(X <= x) = probability, X chi-square distributed.
double chi2_quantile(double probability, double degrees_of_freedom);
/// P(X > chi2), X chi-square distributed.
double chi2_above(double chi2, double degrees_of_freedom);

/// P(X > f), X distributed as Fisher's F.
double fisher_f_above(double f, double numerator_dof, double denominator_dof);

}  // namespace flexcomp::host
