// SPDX-License-Identifier: Apache-2.0
/// \file DETMAX (Mitchell 1974): D-optimal sets by excursions, which grow and shrink the set by several poses
/// and return to its size. The baseline of Chen's Fig. 8.
#pragma once

#include <cstdint>

#include "json.hpp"
#include "planning/exchange.hpp"
#include "planning/search.hpp"

namespace flexcomp::host {

/// Improves `chosen` by excursions until none raises det M; returns log(1/O1), which never grows.
/// \param farthest  largest difference of an excursion from the set's size, poses (Mitchell: 6)
double detmax(const PlanProblem& problem, const CandidatePool& pool, std::vector<std::size_t>& chosen,
              std::mt19937_64& random, std::uint64_t& evaluations, std::size_t farthest = 6);

struct DetmaxOptions {
  std::size_t candidates = 5000;  ///< where the problem has none
  std::uint64_t restarts = 10;    ///< Mitchell: ten
  std::uint64_t seed = 1;
};

/// Restarts detmax() on one pool and keeps the set of the largest determinant.
class DetmaxSearch : public Search {
 public:
  DetmaxSearch(const PlanProblem& problem, const DetmaxOptions& options);
  void step() override;
  double progress() const override {
    return static_cast<double>(next_) / static_cast<double>(options_.restarts);
  }

 protected:
  void save_own(Json& state) const override;
  void load_own(const Json& state) override;

 private:
  DetmaxOptions options_;
  CandidatePool pool_;
  std::uint64_t next_ = 0;
  double least_ = std::numeric_limits<double>::infinity();
};

}  // namespace flexcomp::host
