// SPDX-License-Identifier: Apache-2.0
/// \file
/// Unnamed functions: smooth functions of one or two covariates that turn a joint, ranked by their evidence (D9), and
/// which of their members are relevant (D11).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/residual_analysis.hpp"
#include "measurement/observation.hpp"

namespace flexcomp::host {

/// A quantity that a function may depend on.
struct Variable {
  Covariate kind = Covariate::joint_position;
  unsigned joint = 0;     ///< from 1, where the kind needs one
  bool is_order = false;  ///< of measurement, not a covariate of the core
  Eigen::VectorXd value;  ///< per row
  std::string name() const;
  bool is_joint_position() const { return kind == Covariate::joint_position && !is_order; }
};
std::vector<Variable> variables(const std::vector<Observation>& rows, const Testable& can);

/// Function that is not zero only near one pair of joint readings: the product of a cubic B-spline of each, of knots
/// `spacing_rad` apart, 1 in the middle.
struct Bump {
  std::array<double, 2> centre_rad{};
  double spacing_rad = 0;
};

/// A smooth function of one or two variables that turns a joint: coefficients of members with a normal prior.
struct SmoothFunction {
  Place place;
  std::vector<std::size_t> of = {};  ///< indices of variables, one or two
  double size_rad = 0;               ///< prior standard deviation of a coefficient
  std::optional<Bump> bump = {};     ///< then it has this one member
  int harmonics = 2;                 ///< of each joint reading, in products
  Eigen::VectorXd share = {};        ///< of the size, per member; members of 0 are left out; empty: all of it
  double gain = 0;  ///< evidence (D9): 2 ln of the Bayes factor, less 2 ln of the number of functions tried
};
std::vector<SmoothFunction> smooth_functions(const GapSystem& system, const ResidualAnalysis& left,
                                             const std::vector<Variable>& of, std::size_t most);
/// Values of the function's members (columns, scaled to a prior standard deviation of 1) at given values of its
/// variables; `at[k]` belongs to the range of the variable `function.of[k]`.
Eigen::MatrixXd members(const SmoothFunction& function, const std::vector<Variable>& variables,
                        const std::vector<Eigen::VectorXd>& at);
/// The same at the rows.
Eigen::MatrixXd members(const SmoothFunction& function, const std::vector<Variable>& variables);

/// Standard deviations of the members' own priors by maximum evidence (automatic relevance determination, D11: MacKay
/// 1992; Tipping 2001). `information` and `right` are of the members whose prior is 1. The evidence less 2 per member
/// that stays is put into `gain`.
Eigen::VectorXd relevance(const Eigen::MatrixXd& information, const Eigen::VectorXd& right, double& gain);

/// The best bumps of two joint readings that turn a joint, best first; each has four parameters: size, two centres, width.
std::vector<SmoothFunction> bump_functions(const GapSystem& system, const ResidualAnalysis& left,
                                           const std::vector<Variable>& of, std::size_t most);

/// Adds the effect `unnamed` with the bilinear table that is closest to a function (least squares; docs/model.md, M7).
/// Nothing is added where the function follows the order of measurement, which no controller has.
/// \param value  of its members, rad
void add_smooth_table(const SmoothFunction& function, const Eigen::VectorXd& value,
                      const std::vector<Variable>& variables, const Robot& robot, ParametricModel& model);

}  // namespace flexcomp::host
