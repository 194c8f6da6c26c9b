// SPDX-License-Identifier: Apache-2.0
/// \file
/// Identifiability: rank of the identification matrix, and what each dependent column is confounded with.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "identification/residuals.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// Relative norm after projection onto the other columns below which a column counts as confounded with them. A fitted
/// tool point 0.2 mm off axis 6 stays below it, as a point on the axis does.
constexpr double structural_tolerance = 1e-3;

/// A column that depends linearly on kept ones, and those (empty: the column is zero).
struct DependentColumn {
  std::size_t column = 0;
  std::vector<std::size_t> with;
};

struct Elimination {
  std::vector<std::size_t> kept;  ///< in the order of the columns
  std::vector<DependentColumn> dependent;
};

/// Orthogonalises the columns in the given order and drops each one of which less than `tolerance` of its norm is left
/// after projection onto those kept. Columns are scaled to norm 1 first, so the result depends on neither noise nor units.
Elimination eliminate(const Eigen::MatrixXd& matrix, const std::vector<std::size_t>& order,
                      double tolerance = 1e-6);

/// Triangular factor R of matrix = Q R where the matrix has more rows than columns, else the matrix itself. Rank,
/// confounding and information of the columns are the same.
Eigen::MatrixXd triangular_factor(const Eigen::MatrixXd& matrix);

/// Order in which columns are kept where they are confounded: frames, base x y rx ry, links 1 to 6, effects, and last
/// base z, base rz and the compliance of joint 1, which the paper eliminates too (docs/model.md, section 8).
std::vector<std::size_t> elimination_order(const Unknowns& unknowns, const TermSet& set);

/// Random poses, uniform inside the joint limits, with the kind of measurement and, in turn, the contexts of `like`.
std::vector<Observation> random_observations(const Robot& robot, const std::vector<Observation>& like,
                                             std::size_t count, std::uint64_t seed);

}  // namespace flexcomp::host
