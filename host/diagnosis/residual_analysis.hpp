// SPDX-License-Identifier: Apache-2.0
/// \file
/// A misfit with some blocks taken out, and what it looks like from the places of the chain: where it sits, which
/// covariates it follows, and where along a joint or in time it begins.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_RESIDUAL_ANALYSIS_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_RESIDUAL_ANALYSIS_HPP

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/gap_system.hpp"
#include "diagnosis/subset_search.hpp"
#include "measurement/observation.hpp"

namespace flexcomp::host {

/// What a solution leaves.
struct ResidualAnalysis {
  Eigen::VectorXd residual;   ///< whitened
  Eigen::MatrixXd basis;      ///< of nuisance and blocks: basis basis^T takes residuals to their fit
  double fitted_numbers = 0;  ///< trace of that
  double noise_scale2 = 1;
  double chi2() const { return residual.squaredNorm() / noise_scale2; }
};

ResidualAnalysis remainder(const SubsetSearch& search, const Scored& solution);
/// Nothing found, the noise as declared.
ResidualAnalysis remainder(const GapSystem& system);

/// Shares of all places, largest first: a motion of the place alone, free from pose to pose. p from the chi-square
/// distribution with the moments that the noise gives.
std::vector<PlaceShare> place_shares(const GapSystem& system, const ResidualAnalysis& left);

/// Best local faults of each joint: one cubic B-spline of the reading on a knot spacing of 2 pi / M, wherever it fits;
/// `per_joint` of them, apart from each other, each at `least_touched` rows or more.
struct LocalCurve {
  unsigned joint = 0;  ///< from 1
  std::size_t knots = 0;
  double centre_rad = 0;
  double gain = 0;  ///< over two parameters: size and centre
};
std::vector<LocalCurve> local_curves(const GapSystem& system, const ResidualAnalysis& left,
                                     const std::vector<Observation>& rows, std::size_t per_joint,
                                     std::size_t least_touched);
/// The spline of a local curve at every row.
Eigen::VectorXd local_values(const LocalCurve& curve, const std::vector<Observation>& rows);

/// Times from which on the measured point best lies elsewhere, by gain.
struct Slip {
  double after_s = 0;
  double gain = 0;
};
std::vector<Slip> slips(const GapSystem& system, const ResidualAnalysis& left,
                        const std::vector<Observation>& rows,
                        const std::array<Eigen::VectorXd, 3>& point_columns, std::size_t most);

/// What a function may be a function of.
struct Variable {
  Covariate kind = Covariate::joint_position;
  unsigned joint = 0;     ///< from 1, where the kind needs one
  bool is_order = false;  ///< of measurement, not a covariate of the core
  Eigen::VectorXd value;  ///< per row
  std::string name() const;
};
std::vector<Variable> variables(const std::vector<Observation>& rows, const Testable& can);

/// A function that is not zero only near one pair of joint readings: the product of a cubic B-spline of each, of knots
/// `spacing_rad` apart.
struct Bump {
  std::array<double, 2> centre_rad{};
  double spacing_rad = 0;
};

/// A smooth function of one or two variables that turns a joint.
struct SmoothFunction {
  Place place;
  std::vector<std::size_t> of;  ///< indices of variables, one or two
  double size_rad = 0;          ///< prior standard deviation of a coefficient
  std::optional<Bump> bump;     ///< then it has this one member
  int harmonics = 2;            ///< of each joint reading, in products
  Eigen::VectorXd share;        ///< of the size, per member; members of 0 are left out; empty: all of it
  double gain = 0;  ///< evidence: 2 ln of the Bayes factor, less 2 ln of the number of functions tried
};
std::vector<SmoothFunction> smooth_functions(const GapSystem& system, const ResidualAnalysis& left,
                                             const std::vector<Variable>& of, std::size_t most);
/// The best bumps of two joint readings that turn a joint, best first; each has numbers for size, place and width (4).
std::vector<SmoothFunction> bumps(const GapSystem& system, const ResidualAnalysis& left,
                                  const std::vector<Variable>& of, std::size_t most);
/// Values of the function's members (columns, scaled to a prior standard deviation of 1) at given values of its
/// variables; `at[k]` belongs to the range of the variable `function.of[k]`.
Eigen::MatrixXd members(const SmoothFunction& function, const std::vector<Variable>& variables,
                        const std::vector<Eigen::VectorXd>& at);
/// The same at the rows.
Eigen::MatrixXd members(const SmoothFunction& function, const std::vector<Variable>& variables);

/// Which members of a function matter: for each a prior variance of its own, by maximum evidence (automatic relevance
/// determination: MacKay 1992; Tipping 2001). `information` and `right` are of the members whose prior is 1. Standard
/// deviations; the evidence less 2 per member that stays is put into `gain`.
Eigen::VectorXd relevance(const Eigen::MatrixXd& information, const Eigen::VectorXd& right, double& gain);

}  // namespace flexcomp::host

#endif
