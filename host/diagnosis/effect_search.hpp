// SPDX-License-Identifier: Apache-2.0
/// \file
/// The best explanation of a misfit by the catalogue, and whether anything is left after it.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_EFFECT_SEARCH_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_EFFECT_SEARCH_HPP

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/candidates.hpp"
#include "diagnosis/cross_validation.hpp"
#include "diagnosis/diagnose.hpp"
#include "diagnosis/gap_system.hpp"
#include "diagnosis/residual_analysis.hpp"
#include "diagnosis/subset_search.hpp"

namespace flexcomp::host {

struct Refit;

/// A row that nothing explains costs this much chi-square and no more: it is then an outlier (99.9 % of the chi-square of
/// six numbers, and what it takes to say so of one row among hundreds).
constexpr double outlier_price = 40;

/// Above so many rows what costs time and is decided by the mass of the rows anyhow is left out.
constexpr std::size_t most_few_rows = 300;

/// One part of an explanation with what the linear search found for it.
struct Hypothesis {
  EffectId id;
  std::vector<std::size_t> parameters;  ///< of CandidateSet::parameters; none for local curves and functions
  std::size_t first_parameter = 0;      ///< of these, the first one of the whole effect
  Eigen::VectorXd value;                ///< SI; of a function: of its members, rad
  std::optional<LocalCurve> local;
  std::optional<SmoothFunction> function;
};

struct Explanation {
  std::shared_ptr<GapSystem> system;
  std::shared_ptr<SubsetSearch> search;
  Scored solution;
  std::vector<Hypothesis> pieces;   ///< in the order of solution.blocks
  std::vector<Variable> variables;  ///< that functions refer to
  bool unnamed = false;             ///< something is left, or a function stands in for it
  std::optional<Misfit> misfit;     ///< of what is not named
  std::vector<std::string> notes;
};

class EffectSearch {
 public:
  /// \param start   the fitted model to begin with; \param fitted  what of it the rows can move
  /// \param weight  per row, of that fit
  /// \param poses_scatter  rows differ from pose to pose anyhow: then one row alone shows no local fault
  EffectSearch(const Robot& robot, const std::vector<Observation>& rows, const ContextColumns& columns,
               const Estimate& start, const Unknowns& fitted, const std::vector<double>& weight,
               bool poses_scatter = false);

  const std::vector<NotTestable>& not_testable() const { return candidates_.not_testable; }
  const CandidateSet& candidate_set() const { return candidates_; }

  /// From the start.
  Explanation explain(const std::function<void(double)>& progress) const;
  /// Once more, linearised where a refit with `found` has come to.
  Explanation explain_again(const Refit& refit, const Explanation& found) const;

 private:
  Explanation search(const Estimate& at, const std::vector<bool>& counts, double noise_scale2,
                     const Explanation* before) const;
  /// The start with candidates behind it; those of `found` at their values.
  Estimate extended(const Estimate& nuisance, const Explanation* found) const;
  /// Estimate of the start's own parameters and frames after a refit.
  Estimate nuisance_of(const Refit& refit) const;
  void judge(Explanation& found) const;
  /// What helps on poses that were left out; the rest goes, and others may come in its place.
  Scored prune_by_cross_validation(const SubsetSearch& search, Scored best) const;

  const Robot& robot_;
  const std::vector<Observation>& rows_;
  Estimate start_;
  Unknowns fitted_;
  std::vector<bool> counts_;
  Testable can_;
  CandidateSet candidates_;
  std::vector<Variable> variables_;
  LeftOutPoses left_out_;
  std::size_t least_touched_;
};

bool same_names(const Explanation& a, const Explanation& b);

/// Other names for the blocks of `id`, by BIC.
std::vector<Rival> rivals_of(const SubsetSearch& search, const Scored& solution, const Subset& without,
                             const EffectId& id);

/// Where a named effect sits, as a misfit of the start.
Misfit misfit_of(const FoundEffect& effect, const std::vector<PlaceShare>& places);

}  // namespace flexcomp::host

#endif
