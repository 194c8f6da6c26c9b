// SPDX-License-Identifier: Apache-2.0
#include "planning/detmax.hpp"

#include <algorithm>
#include <limits>
#include <set>

#include "json.hpp"

namespace flexcomp::host {

namespace {

/// A set during an excursion: its candidates, with repeats, and their information matrix.
struct Excursion {
  std::vector<std::size_t> chosen;
  Information information;
};

/// Mitchell's failure list: sets from which an excursion returned without a gain; they are left in the other direction.
using Failures = std::set<std::vector<std::size_t>>;

std::vector<std::size_t> sorted(std::vector<std::size_t> v) {
  std::ranges::sort(v);
  return v;
}

void add_best(const CandidatePool& pool, Excursion& e, std::vector<Figures>& figures,
              std::uint64_t& evaluations) {
  e.information.with_each(pool.blocks, pool.rows, figures);
  evaluations += pool.size();
  std::size_t best = pool.size();
  for (std::size_t c = 0; c < pool.size(); ++c) {
    if (best < pool.size() && !(figures[c].log_det > figures[best].log_det)) continue;
    if (!pool.may_repeat && std::ranges::find(e.chosen, c) != e.chosen.end()) continue;
    best = c;
  }
  e.chosen.push_back(best);
  e.information.add(pool.block(best));
}

void remove_least(const CandidatePool& pool, Excursion& e, std::uint64_t& evaluations) {
  std::size_t least = 0;
  double most_left = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < e.chosen.size(); ++k) {
    Information rest = e.information;
    rest.remove(pool.block(e.chosen[k]));
    if (rest.figures().log_det > most_left) {
      most_left = rest.figures().log_det;
      least = k;
    }
  }
  evaluations += e.chosen.size();
  e.information.remove(pool.block(e.chosen[least]));
  e.chosen.erase(e.chosen.begin() + static_cast<std::ptrdiff_t>(least));
}

}  // namespace

double detmax(const PlanProblem& problem, const CandidatePool& pool, std::vector<std::size_t>& chosen,
              std::mt19937_64& random, std::uint64_t& evaluations, std::size_t farthest) {
  constexpr double least_gain = 1e-9;  // of log det: less is rounding
  const std::size_t n = chosen.size();
  std::vector<Figures> figures;
  Failures failures;
  Excursion best{chosen, problem.of(blocks_of(pool, chosen))};
  for (;;) {
    Excursion e = best;
    Failures passed;
    bool returned = false;
    while (!returned) {
      // At size n the direction is random; elsewhere the excursion returns, unless the failure list has the set.
      bool grow = e.chosen.size() == n ? uniform(random) < 0.5 : e.chosen.size() < n;
      if (e.chosen.size() != n) {
        const std::vector<std::size_t> here = sorted(e.chosen);
        if (failures.count(here) != 0 || !passed.insert(here).second) grow = !grow;
      }
      if (grow && !pool.may_repeat && e.chosen.size() == pool.size()) break;
      if (!grow && e.chosen.size() <= 1) break;
      if (grow) {
        add_best(pool, e, figures, evaluations);
      } else {
        remove_least(pool, e, evaluations);
      }
      if (e.chosen.size() > n + farthest || e.chosen.size() + farthest < n) break;
      returned = e.chosen.size() == n;
    }
    if (returned && e.information.figures().log_det > best.information.figures().log_det + least_gain) {
      best = e;
      failures.clear();
      continue;
    }
    const std::size_t before = failures.size();
    failures.insert(passed.begin(), passed.end());
    // Stop: the excursion exceeded its bound, or added no set to the failure list.
    if (!returned || failures.size() == before) break;
  }
  chosen = best.chosen;
  return problem.criterion(Goal::d_optimal).log_score(best.information.figures());
}

DetmaxSearch::DetmaxSearch(const PlanProblem& problem, const DetmaxOptions& options)
    : Search(problem), options_(options) {
  std::mt19937_64 random = random_of(options.seed, ~std::uint64_t{0});
  pool_ = make_pool(problem, options.candidates, random);
}

void DetmaxSearch::step() {
  if (done()) return;
  std::mt19937_64 random = random_of(options_.seed, next_++);
  std::vector<std::size_t> chosen = random_choice(pool_, problem_.poses, random);
  const double score = detmax(problem_, pool_, chosen, random, evaluations_);
  if (!(score < least_)) return;
  least_ = score;
  const PoseSet set = poses_of(pool_, chosen);
  replace_best(set, problem_.log_fitness(set));
}

void DetmaxSearch::save_own(Json& state) const {
  state["restart"] = next_;
  if (next_ > 0) state["least"] = least_;
}

void DetmaxSearch::load_own(const Json& state) {
  next_ = state.at("restart").get<std::uint64_t>();
  if (state.contains("least")) least_ = state.at("least").get<double>();
}

}  // namespace flexcomp::host
