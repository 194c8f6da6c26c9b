// SPDX-License-Identifier: Apache-2.0
#include "planning/exchange.hpp"

#include <algorithm>
#include <numeric>

namespace flexcomp::host {

namespace {

/// Gains below this are rounding.
constexpr double least_gain = 1e-10;

/// Packs a symmetric matrix into a vector, such that the dot product of packed(w) and packed_twice(m) is tr(W M).
Eigen::VectorXd packed(const Eigen::MatrixXd& w) {
  Eigen::VectorXd out(w.rows() * (w.rows() + 1) / 2);
  Eigen::Index k = 0;
  for (Eigen::Index c = 0; c < w.cols(); ++c) {
    for (Eigen::Index r = c; r < w.rows(); ++r) out[k++] = w(r, c);
  }
  return out;
}

Eigen::VectorXd packed_twice(const Eigen::MatrixXd& m) {
  Eigen::MatrixXd twice = 2 * m;
  twice.diagonal() = m.diagonal();
  return packed(twice);
}

/// Limit of CandidatePool::squares, 5 kB each.
constexpr std::size_t most_squares = 20000;

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
  if (pool.size() <= most_squares) {
    const Eigen::Index unknowns = problem.information->unknowns();
    pool.squares.resize(unknowns * (unknowns + 1) / 2, static_cast<Eigen::Index>(pool.size()));
    for (std::size_t k = 0; k < pool.size(); ++k) {
      h = pool.block(k);
      pool.squares.col(static_cast<Eigen::Index>(k)) = packed_twice(h * h.transpose());
    }
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
  PoseSet set(chosen.size());
  for (std::size_t k = 0; k < chosen.size(); ++k) set[k] = pool.poses[chosen[k]];
  return set;
}

std::vector<Block> blocks_of(const CandidatePool& pool, const std::vector<std::size_t>& chosen) {
  std::vector<Block> blocks(chosen.size());
  for (std::size_t k = 0; k < chosen.size(); ++k) blocks[k] = pool.block(chosen[k]);
  return blocks;
}

double exchange(const PlanProblem& problem, const CandidatePool& pool, const Criterion& criterion,
                std::vector<std::size_t>& chosen, std::uint64_t& evaluations, int most_rounds) {
  std::vector<Block> blocks = blocks_of(pool, chosen);
  Information now = problem.of(blocks);
  double score = criterion.log_score(now.figures());
  std::vector<char> taken(pool.size(), 0);
  if (!pool.may_repeat) {
    for (const std::size_t c : chosen) taken[c] = 1;
  }
  // The log score is convex in M: with its gradient W, replacing M_k by M_c scores at least score + tr(W (M_c - M_k)).
  // Hence only candidates with tr(W M_c) < tr(W M_k) can gain, few near the end. W changes only with the set.
  Eigen::VectorXd slope;
  const auto update_slope = [&] {
    const Eigen::MatrixXd w = now.gradient(criterion);
    slope.resize(static_cast<Eigen::Index>(pool.size()));
    if (pool.squares.cols() == slope.size()) {
      slope.noalias() = pool.squares.transpose() * packed(w);
    } else {
      for (std::size_t c = 0; c < pool.size(); ++c) {
        const auto h = pool.blocks.middleCols(static_cast<Eigen::Index>(c) * pool.rows, pool.rows);
        slope[static_cast<Eigen::Index>(c)] = h.cwiseProduct(w * h).sum();
      }
    }
    evaluations += pool.size();
  };
  update_slope();
  std::size_t unchanged = 0;
  for (int round = 0; round < most_rounds && unchanged < chosen.size(); ++round) {
    for (std::size_t k = 0; k < chosen.size() && unchanged < chosen.size(); ++k) {
      ++unchanged;
      const double own = slope[static_cast<Eigen::Index>(chosen[k])];
      Information rest = now;
      bool removed = false;
      std::size_t best = chosen[k];
      double least = score;
      for (std::size_t c = 0; c < pool.size(); ++c) {
        if (taken[c] != 0 || !(slope[static_cast<Eigen::Index>(c)] < own)) continue;
        if (!removed) rest.remove(blocks[k]);
        removed = true;
        ++evaluations;
        const double s = criterion.log_score(rest.with(pool.block(c)));
        if (s < least) {
          least = s;
          best = c;
        }
      }
      if (best == chosen[k] || !(least < score - least_gain)) continue;
      if (!pool.may_repeat) std::swap(taken[chosen[k]], taken[best]);
      chosen[k] = best;
      blocks[k] = pool.block(best);
      rest.add(blocks[k]);
      now = rest;
      score = criterion.log_score(now.figures());
      update_slope();
      unchanged = 0;
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
