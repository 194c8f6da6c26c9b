// SPDX-License-Identifier: Apache-2.0
/// \file Exchange algorithm (Fedorov; Cook and Nachtsheim): each pose of the set in turn is replaced by the
/// best candidate, until a full pass changes nothing.
#pragma once

#include <cstdint>
#include <vector>

#include "json.hpp"
#include "planning/search.hpp"

namespace flexcomp::host {

/// Candidates with their rows of H side by side: each pose with each payload.
struct CandidatePool {
  PoseSet poses;
  Eigen::MatrixXd blocks;
  Eigen::MatrixXd squares;  ///< HHᵀ of each as a column, one triangle; empty above 20,000 candidates
  Eigen::Index rows = 6;    ///< numbers measured per pose
  bool may_repeat = true;   ///< one candidate may be chosen several times

  std::size_t size() const { return poses.size(); }
  Block block(std::size_t k) const { return blocks.middleCols(static_cast<Eigen::Index>(k) * rows, rows); }
};

/// The problem's candidates with every payload (each at most once), or `count` random feasible poses.
CandidatePool make_pool(const PlanProblem& problem, std::size_t count, std::mt19937_64& random);

/// Indices of distinct random candidates; with repeats only where there are too few.
std::vector<std::size_t> random_choice(const CandidatePool& pool, std::size_t count, std::mt19937_64& random);

/// Exchanges poses of `chosen` until nothing changes (or `most_rounds`). Returns the log score of `criterion`,
/// which never grows.
double exchange(const PlanProblem& problem, const CandidatePool& pool, const Criterion& criterion,
                std::vector<std::size_t>& chosen, std::uint64_t& evaluations, int most_rounds = 1000);

PoseSet poses_of(const CandidatePool& pool, const std::vector<std::size_t>& chosen);
std::vector<Block> blocks_of(const CandidatePool& pool, const std::vector<std::size_t>& chosen);

struct ExchangeOptions {
  std::size_t candidates = 5000;  ///< where the problem has none
  std::uint64_t restarts = 20;
  Goal goal = Goal::dual;
  std::uint64_t seed = 1;
};

/// Restarts exchange() on one pool; each step is one restart.
class ExchangeSearch : public Search {
 public:
  ExchangeSearch(const PlanProblem& problem, const ExchangeOptions& options);
  void step() override;
  double progress() const override {
    return static_cast<double>(next_) / static_cast<double>(options_.restarts);
  }

 protected:
  void save_own(Json& state) const override { state["restart"] = next_; }
  void load_own(const Json& state) override { next_ = state.at("restart").get<std::uint64_t>(); }

 private:
  ExchangeOptions options_;
  CandidatePool pool_;
  std::uint64_t next_ = 0;
};

}  // namespace flexcomp::host
