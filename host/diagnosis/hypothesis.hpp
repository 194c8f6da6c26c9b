// SPDX-License-Identifier: Apache-2.0
/// \file
/// Hypotheses on the cause of a misfit, and a search's selection of them.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/local_faults.hpp"
#include "diagnosis/result.hpp"
#include "diagnosis/smooth_functions.hpp"
#include "diagnosis/subset_search.hpp"

namespace flexcomp::host {

/// One selected cause: an effect of the catalogue, a local fault or an unnamed function, with its linear estimate.
struct Hypothesis {
  EffectId id;
  std::vector<std::size_t> parameters;  ///< of CandidateSet::parameters; none for local faults and functions
  std::size_t first_parameter = 0;      ///< of these, the first one of the whole effect
  Eigen::VectorXd value;                ///< SI; of a function: of its members, rad
  std::optional<LocalCurve> local;
  std::optional<SmoothFunction> function;
};

/// Selected hypotheses, and the linear system in which they were selected.
struct SearchResult {
  std::shared_ptr<GapSystem> system;
  std::shared_ptr<SubsetSearch> search;
  Scored solution;
  std::vector<Hypothesis> hypotheses;  ///< in the order of solution.blocks
  std::vector<Variable> variables;     ///< that functions refer to
  bool unnamed = false;                ///< lack of fit, or a function without a name stands in for it
  std::optional<Misfit> misfit;        ///< of what is not named
  std::vector<std::string> notes;
};

}  // namespace flexcomp::host
