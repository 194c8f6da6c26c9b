// SPDX-License-Identifier: Apache-2.0
/// \file
/// Blocks that scans of a residual append to a linear system while it is searched: local faults, steps of the measured
/// point, unnamed functions.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "diagnosis/local_faults.hpp"
#include "diagnosis/smooth_functions.hpp"
#include "diagnosis/subset_search.hpp"
#include "measurement/observation.hpp"

namespace flexcomp::host {

/// What a step of the measured point is made of: whitened columns of its translations, and its candidate.
struct SlipColumns {
  EffectId id;
  std::array<Eigen::VectorXd, 3> point;
  std::size_t candidate = 0;  ///< index into CandidateSet::list
  std::vector<std::size_t> parameters;
};
/// Nothing where the candidates have no step. \param counts  rows that are not left out
std::optional<SlipColumns> slip_columns(const Robot& robot, const std::vector<Observation>& rows,
                                        const std::vector<bool>& counts, const Estimate& at,
                                        const CandidateSet& candidates);

class ScannedBlocks {
 public:
  ScannedBlocks(GapSystem& system, SubsetSearch& search, const std::vector<Observation>& rows,
                const std::vector<Variable>& variables, std::optional<SlipColumns> slip)
      : system_(system), search_(search), rows_(rows), variables_(variables), slip_(std::move(slip)) {}

  /// Adds each local fault as one spline (D7) and as a fault of any shape, scored by its evidence (D3).
  void add_local_faults(const std::vector<LocalCurve>& fresh);
  /// Scans a residual for local faults and slips, and updates the search.
  void scan(const ResidualAnalysis& left, std::size_t per_joint, std::size_t least_touched);
  /// Adds functions that are not there yet. \param cost  parameters that having tried so many functions counts as
  void add_functions(const std::vector<SmoothFunction>& fresh, double cost);

  /// Replaces the functions of a solution by their relevant members (D11), with finer harmonics where they gain: the
  /// effects are decided, and what counts is prediction.
  Scored with_relevant_members(Scored best);

  const LocalCurve& local_fault(const Block& block) const { return locals_[block.scanned]; }
  const SmoothFunction& function(const Block& block) const { return functions_[block.scanned]; }

 private:
  void add_slips(const std::vector<Slip>& found);
  /// False where nothing of the function is left after the projection: no block is added.
  bool add_function(const SmoothFunction& f, double cost);
  std::optional<SmoothFunction> relevant_members(const SmoothFunction& function, const Subset& others,
                                                 double cost);

  GapSystem& system_;
  SubsetSearch& search_;
  const std::vector<Observation>& rows_;
  const std::vector<Variable>& variables_;
  std::optional<SlipColumns> slip_;
  std::vector<LocalCurve> locals_;
  std::vector<SmoothFunction> functions_;
};

}  // namespace flexcomp::host
