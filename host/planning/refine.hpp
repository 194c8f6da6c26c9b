// SPDX-License-Identifier: Apache-2.0
/// \file
/// The default method: exchange over a few hundred random poses, then projected L-BFGS over all joint positions, then
/// iterated local search that replaces one pose and refines again.
#pragma once

#include <cstdint>

#include "json.hpp"
#include "planning/search.hpp"

namespace flexcomp::host {

/// Minimises the criterion over all joint positions of a set (projected L-BFGS, Nocedal and Wright, chapter 7); a pose
/// whose step is not feasible takes a shorter one or stays. Returns the log fitness, which never grows.
double descend(const PlanProblem& problem, PoseSet& set, int most_steps, double tolerance,
               std::uint64_t& evaluations);

struct RefineOptions {
  std::uint64_t evaluations = 400000;  ///< of the whole search
  std::size_t candidates = 300;        ///< of the exchange that starts it
  std::size_t replacements = 60;       ///< random poses tried in place of one
  std::uint64_t seed = 1;
};

/// Iterated local search; each step is one start, or one replacement and the descent after it.
class RefineSearch : public Search {
 public:
  RefineSearch(const PlanProblem& problem, const RefineOptions& options)
      : Search(problem), options_(options) {}
  void step() override;
  double progress() const override {
    return static_cast<double>(evaluations_) / static_cast<double>(options_.evaluations);
  }

 protected:
  void save_own(Json& state) const override;
  void load_own(const Json& state) override;

 private:
  RefineOptions options_;
  std::uint64_t next_ = 0;
  PoseSet current_;
  double current_log_ = 0;
};

}  // namespace flexcomp::host
