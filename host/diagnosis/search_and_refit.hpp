// SPDX-License-Identifier: Apache-2.0
/// \file
/// Search and nonlinear refit in turns, until the selected effects stay.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_SEARCH_AND_REFIT_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_SEARCH_AND_REFIT_HPP

#include <memory>
#include <vector>

#include "diagnosis/effect_search.hpp"
#include "diagnosis/refit.hpp"

namespace flexcomp::host {

/// Converged search with its refit, on rows of a given noise.
struct Selection {
  std::unique_ptr<const std::vector<Observation>> rows;
  FittedModel start;
  std::unique_ptr<const EffectSearch> search;
  SearchResult found;
  Refit refit;
};

/// \param poses_scatter  as of EffectSearch \param done  share of the diagnosis that was done before
Selection search_and_refit(const Robot& robot, const std::vector<Observation>& rows,
                           const ContextColumns& columns, const FittedModel& start, bool poses_scatter,
                           const DiagnosisProgress& progress, double done);

}  // namespace flexcomp::host

#endif
