#include "planning/exchange.hpp"

#include <algorithm>
#include <numeric>

namespace flexcomp::host {

namespace {

/// Gains below this are rounding.
constexpr double least_gain = 1e-10;

}  // namespace

CandidatePool make_pool(const PlanProblem& problem, std::size_t count, std::mt19937_64& random) {
  CandidatePool pool;
  pool.rows = problem.instrument.rows();
  if (problem.candidates.empty()) {
    for (std::size_t k = 0; k < count; ++k) pool.poses.push_back(problem.random_pose(random));
  } else {
    pool.may_repeat = false;
    pool.poses = problem.candidates;
  }
  pool.blocks.resize(problem.information->unknowns(), static_cast<Eigen::Index>(pool.size()) * pool.rows);
  Block h;
  for (std::size_t k = 0; k < pool.size(); ++k) {
    problem.block(pool.poses[k], h);
    pool.blocks.middleCols(static_cast<Eigen::Index>(k) * pool.rows, pool.rows) = h;
  }
  return pool;
}

std::vector<std::size_t> random_choice(const CandidatePool& pool, std::size_t count,
                                       std::mt19937_64& random) {
  std::vector<std::size_t> all(pool.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  const std::size_t distinct = std::min(count, all.size());
  for (std::size_t k = 0; k < distinct; ++k) std::swap(all[k], all[k + below(all.size() - k, random)]);
  std::vector<std::size_t> chosen(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(distinct));
  while (chosen.size() < count) chosen.push_back(below(pool.size(), random));
  return chosen;
}

PoseSet poses_of(const CandidatePool& pool, const std::vector<std::size_t>& chosen) {
  PoseSet set;
  for (const std::size_t c : chosen) set.push_back(pool.poses[c]);
  return set;
}

double exchange(const PlanProblem& problem, const CandidatePool& pool, const Criterion& criterion,
                std::vector<std::size_t>& chosen, std::uint64_t& evaluations, int most_rounds) {
  std::vector<Block> blocks;
  for (const std::size_t c : chosen) blocks.push_back(pool.block(c));
  Information rest = problem.of(blocks);
  double score = criterion.log_score(rest.figures());
  std::vector<char> taken(pool.size(), 0);
  if (!pool.may_repeat) {
    for (const std::size_t c : chosen) taken[c] = 1;
  }
  std::vector<Figures> figures;
  std::size_t unchanged = 0;
  for (int round = 0; round < most_rounds && unchanged < chosen.size(); ++round) {
    for (std::size_t k = 0; k < chosen.size() && unchanged < chosen.size(); ++k) {
      rest.remove(blocks[k]);
      rest.with_each(pool.blocks, pool.rows, figures);
      evaluations += pool.size();
      std::size_t best = chosen[k];
      double least = criterion.log_score(figures[best]);
      for (std::size_t c = 0; c < pool.size(); ++c) {
        if (taken[c] != 0) continue;
        const double s = criterion.log_score(figures[c]);
        if (s < least) {
          least = s;
          best = c;
        }
      }
      if (best != chosen[k] && least < criterion.log_score(figures[chosen[k]]) - least_gain) {
        if (!pool.may_repeat) std::swap(taken[chosen[k]], taken[best]);
        chosen[k] = best;
        blocks[k] = pool.block(best);
        score = least;
        unchanged = 0;
      } else {
        ++unchanged;
      }
      rest.add(blocks[k]);
    }
  }
  return score;
}

ExchangeSearch::ExchangeSearch(const PlanProblem& problem, const ExchangeOptions& options)
    : Search(problem), options_(options) {
  std::mt19937_64 random = random_of(options.seed, ~std::uint64_t{0});
  pool_ = make_pool(problem, options.candidates, random);
}

void ExchangeSearch::step() {
  if (done()) return;
  std::mt19937_64 random = random_of(options_.seed, next_++);
  std::vector<std::size_t> chosen = random_choice(pool_, problem_.poses, random);
  exchange(problem_, pool_, problem_.criterion(options_.goal), chosen, evaluations_);
  const PoseSet set = poses_of(pool_, chosen);
  offer(set, problem_.log_fitness(set));
}

}  // namespace flexcomp::host
