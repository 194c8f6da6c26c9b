// SPDX-License-Identifier: Apache-2.0
/// \file
/// Search for the hypotheses that explain a misfit: blocks of the catalogue, scans and functions (D2 to D11), pruning on
/// left-out poses (D12), rows that are outliers or structure (D13), lack of fit (D14). Search and nonlinear refit in turns,
/// until the selected effects stay.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "diagnosis/candidates.hpp"
#include "diagnosis/cross_validation.hpp"
#include "diagnosis/hypothesis.hpp"
#include "diagnosis/refit.hpp"
#include "diagnosis/scanned_blocks.hpp"

namespace flexcomp::host {

class EffectSearch {
 public:
  /// \param poses_scatter  rows differ from pose to pose anyhow: then one row alone shows no local fault
  EffectSearch(const Robot& robot, const std::vector<Observation>& rows, const ContextColumns& columns,
               const FittedModel& start, bool poses_scatter = false);

  const std::vector<NotTestable>& not_testable() const { return candidates_.not_testable; }
  const CandidateSet& candidate_set() const { return candidates_; }

  /// From the start. \param progress  called with the share that is done
  SearchResult run(const std::function<void(double)>& progress) const;
  /// Linearised at a refit with `found`.
  SearchResult run_again(const Refit& refit, const SearchResult& found) const;

 private:
  /// Searches in turns with the refit that decides which rows are down-weighted.
  struct Settled {
    SearchResult found;
    Refit refit;
    double cost = 0;  // (D13)
  };
  Settled settle(std::vector<bool> counts, double noise_scale2) const;

  /// One search on the system that is linearised at an estimate. \param before  its local faults are tried again
  SearchResult search(const Estimate& at, const std::vector<bool>& counts, double noise_scale2,
                      const SearchResult* before) const;
  Scored select_effects(ScannedBlocks& scanned, SubsetSearch& search) const;
  Scored select_functions(const GapSystem& system, ScannedBlocks& scanned, SubsetSearch& search,
                          Scored best) const;
  std::vector<Hypothesis> hypotheses_of(const SearchResult& result, const ScannedBlocks& scanned,
                                        const Estimate& at) const;
  /// The candidates behind the start's terms, these at the values of `nuisance`; candidates of `found` at theirs.
  Estimate extended(const Estimate& nuisance, const SearchResult* found) const;

  const Robot& robot_;
  const std::vector<Observation>& rows_;
  FittedModel start_;
  CandidateSet candidates_;
  std::vector<Variable> variables_;
  LeftOutPoses left_out_;
  std::size_t least_touched_;
};

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
