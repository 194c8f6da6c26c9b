// SPDX-License-Identifier: Apache-2.0
#include "report/models.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "input_error.hpp"
#include "linalg/blas.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {
namespace {

/// Below this a row hangs on a parameter that only it makes known.
constexpr double least_left = 1e-6;

/// Residuals of rows that the fit did not see.
std::optional<std::vector<RowResidual>> left_out(const Identification& r, const HostModel& model,
                                                 const std::vector<Observation>& rows) {
  Unknowns free = r.identifiability.fitted;
  // A parameter at its bound stays there whichever row is missing.
  free.parameters.clear();
  for (std::size_t p = 0; p < r.identifiability.fitted.parameters.size(); ++p) {
    if (!r.fit.at_bound[p]) free.parameters.push_back(r.identifiability.fitted.parameters[p]);
  }
  const Linearised lin = linearised(r.fit.estimate, model, rows, free);
  Eigen::MatrixXd weighted = lin.derivative;
  for (std::size_t k = 0; k < rows.size(); ++k)
    weighted.middleRows<6>(static_cast<Eigen::Index>(6 * k)) *= std::sqrt(r.fit.weight[k]);
  const Eigen::Index n = weighted.cols();
  if (weighted.rows() < n) return std::nullopt;
  const Eigen::MatrixXd upper = upper_factor(weighted);
  if (!(upper.diagonal().cwiseAbs().minCoeff() > 0)) return std::nullopt;
  // Rows of this are orthonormal over all: H_ii = A_i A_i^T.
  Eigen::MatrixXd a = weighted.transpose();
  solve_lower(upper.transpose(), a);
  a.transposeInPlace();
  std::vector<RowResidual> out(rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const Eigen::Index size = rows[k].has_orientation ? 6 : 3;
    const auto at = static_cast<Eigen::Index>(6 * k);
    const Eigen::MatrixXd block = a.middleRows(at, size);
    const Eigen::MatrixXd rest = Eigen::MatrixXd::Identity(size, size) - block * block.transpose();
    const SymmetricEigen eigen = symmetric_eigen(rest);
    if (!(eigen.values[0] > least_left)) return std::nullopt;
    const Eigen::VectorXd whitened = eigen.vectors * eigen.values.cwiseInverse().asDiagonal() *
                                     eigen.vectors.transpose() * lin.residual.segment(at, size);
    const Eigen::VectorXd e = rows[k].whitening.topLeftCorner(size, size).lu().solve(whitened);
    out[k].position_m = e.head<3>();
    if (size == 6) out[k].orientation_rad = e.tail<3>();
  }
  return out;
}

std::vector<double> lengths(const std::vector<RowResidual>& errors) {
  std::vector<double> out;
  out.reserve(errors.size());
  for (const RowResidual& e : errors) out.push_back(e.position_m.norm());
  return out;
}

}  // namespace

std::vector<ModelFit> compare_models(const Robot& robot, const std::vector<Observation>& rows,
                                     const std::string& source, const IdentifyOptions& options) {
  std::vector<ModelFit> list;
  for (const ModelKind kind :
       {ModelKind::full, ModelKind::no_gravity, ModelKind::no_stiffness, ModelKind::geometric}) {
    IdentifyOptions plain = options;
    plain.model = kind;
    plain.fixed.clear();
    plain.tolerances.clear();
    ModelFit m;
    m.kind = kind;
    try {
      const Identification r = identify(robot, rows, source, plain);
      if (r.identifiability.fitted.count() == 0 || !r.fit.converged) continue;
      const auto model = prepare(r.fit.estimate.set, robot, source);
      m.parameters = r.identifiable;
      m.fitted = r.after;
      m.chi2_per_dof = r.fit.chi2_per_dof();
      if (const auto errors = left_out(r, *model, rows)) {
        m.left_out = statistics(*errors, rows);
        m.left_out_m = lengths(*errors);
      }
    } catch (const InputError&) {
      continue;  // a base beyond 20 mm, say: this model does not fit these rows at all
    }
    list.push_back(std::move(m));
  }
  return list;
}

std::string model_words(ModelKind kind) {
  switch (kind) {
    case ModelKind::geometric:
      return "geometry alone";
    case ModelKind::no_gravity:
      return "without link gravity";
    case ModelKind::no_stiffness:
      return "without joint compliance";
    case ModelKind::full:
      break;
  }
  return "rigid-flexible, in full";
}

}  // namespace flexcomp::host
