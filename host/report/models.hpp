// SPDX-License-Identifier: Apache-2.0
/// \file
/// The paper's comparison of models (Chen et al. 2019, Fig. 3 and Fig. 10): each fitted to the same rows, and judged on rows
/// that it was not fitted to.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "identification/identify.hpp"

namespace flexcomp::host {

struct ModelFit {
  ModelKind kind = ModelKind::full;
  std::size_t parameters = 0;  ///< identifiable
  ErrorStatistics fitted;      ///< on the rows that it was fitted to
  double chi2_per_dof = 0;
  /// The same where each row in turn is left out of the fit and then predicted; nothing where a row alone makes a
  /// parameter known.
  std::optional<ErrorStatistics> left_out;
  std::vector<double> left_out_m;
};

/// Full, without link gravity, without joint compliance, geometry alone. A model that cannot be fitted to these rows is
/// left out.
///
/// Rows are left out by the hat matrix: the residual without row i is (1 - H_ii)^-1 e_i, with H_ii = J_i (J^T J)^-1 J_i^T of
/// the whitened, weighted derivative J (Cook and Weisberg 1982, Section 2.2; exact for a linear model, which the arm is over
/// the size of its errors).
std::vector<ModelFit> compare_models(const Robot& robot, const std::vector<Observation>& rows,
                                     const std::string& source, const IdentifyOptions& options);

/// "rigid-flexible", "without link gravity" …
std::string model_words(ModelKind kind);

}  // namespace flexcomp::host
