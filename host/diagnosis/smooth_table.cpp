// SPDX-License-Identifier: Apache-2.0
// An unnamed function as a table that the core reads (docs/model.md, M7).

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "diagnosis/smooth_functions.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Fine positions along one side of a grid, and the node values of the least-squares broken line through values there.
struct BrokenLine {
  explicit BrokenLine(const std::vector<double>& nodes) {
    constexpr Eigen::Index steps = 8;
    const Eigen::Index cells = static_cast<Eigen::Index>(nodes.size()) - 1;
    at.resize(cells * steps + 1);
    Eigen::MatrixXd hats = Eigen::MatrixXd::Zero(at.size(), cells + 1);
    for (Eigen::Index k = 0; k < at.size(); ++k) {
      const Eigen::Index cell = std::min(k / steps, cells - 1);
      const double share = static_cast<double>(k - cell * steps) / steps;
      const auto from = static_cast<std::size_t>(cell);
      at[k] = nodes[from] + share * (nodes[from + 1] - nodes[from]);
      hats(k, cell) = 1 - share;
      hats(k, cell + 1) = share;
    }
    nearest = Llt(hats.transpose() * hats).solve(Eigen::MatrixXd(hats.transpose()));
  }
  Eigen::VectorXd at;
  Eigen::MatrixXd nearest;  ///< node values = nearest * values
};

/// Nodes of one side, close together where the bump is, in every turn between low and high.
std::vector<double> nodes_of(const Bump& bump, std::size_t side, double low, double high) {
  std::vector<double> nodes{low, high};
  const double first = bump.centre_rad[side] + 2 * pi * std::floor((low - bump.centre_rad[side]) / (2 * pi));
  for (double centre = first; centre < high + 2 * pi; centre += 2 * pi) {
    for (int k = -4; k <= 4; ++k) {
      const double at = centre + 0.5 * bump.spacing_rad * k;
      if (at > low && at < high) nodes.push_back(at);
    }
  }
  std::ranges::sort(nodes);
  nodes.erase(std::unique(nodes.begin(), nodes.end(), [](double a, double b) { return b - a < 1e-6; }),
              nodes.end());
  return nodes;
}

/// The effect with its nodes along one or two variables.
EffectId table_id(const SmoothFunction& function, const std::vector<const Variable*>& of) {
  constexpr std::size_t nodes = 25;
  EffectId id{.effect = Effect::unnamed};
  id.place = function.place;
  for (std::size_t side = 0; side < 2; ++side) {
    if (side >= of.size()) {
      // Of one variable: the same at every load.
      id.covariate[side] = Covariate::payload;
      id.node[side] = {0, 1};
      continue;
    }
    id.covariate[side] = of[side]->kind;
    id.covariate_joint[side] = of[side]->joint;
    const double low = of[side]->value.minCoeff();
    const double high = of[side]->value.maxCoeff();
    if (function.bump) {
      id.node[side] = nodes_of(*function.bump, side, low, high);
      continue;
    }
    const std::size_t count = of[side]->kind == Covariate::joint_position ? nodes : 5;
    for (std::size_t k = 0; k < count; ++k)
      id.node[side].push_back(low + (high - low) * static_cast<double>(k) / static_cast<double>(count - 1));
  }
  return id;
}

}  // namespace

void add_smooth_table(const SmoothFunction& function, const Eigen::VectorXd& value,
                      const std::vector<Variable>& variables, const Robot& robot, ParametricModel& model) {
  std::vector<const Variable*> of;
  for (const std::size_t v : function.of) of.push_back(&variables[v]);
  if (std::ranges::any_of(of, [](const Variable* v) { return v->is_order; })) return;
  const EffectId id = table_id(function, of);
  add_effect(model, id, robot.nominal);
  const Term<double>& term = model.set.terms.back();
  double* values =
      model.set.values.data() + model.set.tables[term.table].offset + id.node[0].size() + id.node[1].size();
  // Not the function's values at the nodes, but those of the closest piecewise bilinear function.
  const std::array<BrokenLine, 2> line{BrokenLine(id.node[0]), BrokenLine(id.node[1])};
  const Eigen::Index rows = line[0].at.size();
  const Eigen::Index columns = line[1].at.size();
  std::vector<Eigen::VectorXd> at(of.size(), Eigen::VectorXd(rows * columns));
  for (Eigen::Index r = 0; r < rows; ++r) {
    for (Eigen::Index c = 0; c < columns; ++c) {
      at[0][r * columns + c] = line[0].at[r];
      if (at.size() > 1) at[1][r * columns + c] = line[1].at[c];
    }
  }
  const Eigen::MatrixXd phi = members(function, variables, at);
  // Columns that the projection took away have no coefficient: then the numbers differ, and the function is as it was.
  if (phi.cols() != value.size()) return;
  const Eigen::VectorXd v = phi * value;
  const Eigen::Map<const RowMajor> fine(v.data(), rows, columns);
  const RowMajor coarse = line[0].nearest * fine * line[1].nearest.transpose();
  for (Eigen::Index k = 0; k < coarse.size(); ++k) values[k] = coarse.data()[k];
}

}  // namespace flexcomp::host
