// SPDX-License-Identifier: Apache-2.0
#include "planning/planner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "planning/detmax.hpp"
#include "planning/exchange.hpp"
#include "planning/refine.hpp"
#include "planning/sapso.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

template <class Number>
std::uint64_t scaled(Number number, double effort) {
  return static_cast<std::uint64_t>(std::max(1.0, std::round(static_cast<double>(number) * effort)));
}

using Speeds = std::array<double, joint_count>;

/// Travel time, s, between joint positions at the joints' largest speeds; largest rotation, rad, where a speed
/// is unknown.
double distance(const Joints& a, const Joints& b, const Speeds& speed) {
  const bool has_speeds = std::ranges::all_of(speed, [](double v) { return v > 0; });
  double longest = 0;
  for (std::size_t j = 0; j < joint_count; ++j) {
    longest = std::max(longest, std::abs(a[j] - b[j]) / (has_speeds ? speed[j] : 1));
  }
  return longest;
}

/// Short open path through a set by nearest neighbour and 2-opt. \param from  position before the first pose, if any
PoseSet short_path(const PoseSet& set, const std::optional<Joints>& from, const Speeds& speed) {
  const std::size_t n = set.size();
  const auto step = [&](std::size_t a, std::size_t b) { return distance(set[a].q_rad, set[b].q_rad, speed); };
  const auto entry = [&](std::size_t a) { return from ? distance(*from, set[a].q_rad, speed) : 0.0; };
  std::vector<std::size_t> best;
  double shortest = std::numeric_limits<double>::infinity();
  for (std::size_t start = 0; start < std::min<std::size_t>(n, 50); ++start) {
    std::vector<std::size_t> path{start};
    std::vector<char> taken(n, 0);
    taken[start] = 1;
    while (path.size() < n) {
      std::size_t next = n;
      for (std::size_t k = 0; k < n; ++k) {
        if (taken[k] == 0 && (next == n || step(path.back(), k) < step(path.back(), next))) next = k;
      }
      taken[next] = 1;
      path.push_back(next);
    }
    // 2-opt: reverse a section wherever that is shorter.
    for (bool changed = true; changed;) {
      changed = false;
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t k = i + 1; k < n; ++k) {
          double gain = i > 0 ? step(path[i - 1], path[i]) - step(path[i - 1], path[k])
                              : entry(path[i]) - entry(path[k]);
          if (k + 1 < n) gain += step(path[k], path[k + 1]) - step(path[i], path[k + 1]);
          if (gain > 1e-9) {
            std::reverse(path.begin() + static_cast<std::ptrdiff_t>(i),
                         path.begin() + static_cast<std::ptrdiff_t>(k) + 1);
            changed = true;
          }
        }
      }
    }
    double length = entry(path.front());
    for (std::size_t k = 1; k < n; ++k) length += step(path[k - 1], path[k]);
    if (length < shortest) {
      shortest = length;
      best = path;
    }
  }
  PoseSet out;
  for (const std::size_t k : best) out.push_back(set[k]);
  return out;
}

double rounded_angle(double rad, int decimals) {
  return *parse_si(fmt::format("{:.{}f}", degrees(rad), decimals), unit::degree);
}

}  // namespace

bool moves_joints(Method method) { return method == Method::refine || method == Method::sapso; }

std::unique_ptr<Search> make_search(Method method, const PlanProblem& problem, double effort,
                                    std::uint64_t seed) {
  switch (method) {
    case Method::refine:
      return std::make_unique<RefineSearch>(
          problem, RefineOptions{.evaluations = scaled(RefineOptions().evaluations, effort), .seed = seed});
    case Method::exchange: {
      ExchangeOptions options;
      // About seven rounds until nothing changes.
      const std::size_t pool = problem.candidates.empty() ? options.candidates : problem.candidates.size();
      const double per_restart = 7.0 * static_cast<double>(problem.poses * pool);
      options.restarts = scaled(std::clamp(5e6 / per_restart, 3.0, 200.0), effort);
      options.seed = seed;
      return std::make_unique<ExchangeSearch>(problem, options);
    }
    case Method::detmax:
      return std::make_unique<DetmaxSearch>(
          problem, DetmaxOptions{.restarts = scaled(DetmaxOptions().restarts, effort), .seed = seed});
    case Method::sapso:
      return std::make_unique<SapsoSearch>(
          problem, SapsoOptions{.iterations = scaled(SapsoOptions().iterations, effort), .seed = seed});
  }
  return nullptr;
}

ExactFigures figures_of(const PlanProblem& problem, const PoseSet& set) {
  std::vector<Block> blocks = problem.measured;
  for (Block& h : problem.blocks(set)) blocks.push_back(std::move(h));
  return exact_figures(blocks, problem.information->nuisance());
}

std::optional<std::size_t> least_poses(const PlanProblem& problem, std::uint64_t seed) {
  constexpr int tries = 3;
  std::mt19937_64 random = random_of(seed, 0);
  std::optional<std::size_t> least;
  for (int k = 0; k < tries; ++k) {
    PoseSet order = problem.candidates;
    for (std::size_t c = order.size(); c > 1; --c) std::swap(order[c - 1], order[below(c, random)]);
    const std::size_t most = order.empty() ? 1000 : order.size();
    PoseSet set;
    if (!problem.measured.empty() && figures_of(problem, set).full_rank) return 0;
    while (set.size() < std::min(most, least.value_or(most))) {
      set.push_back(order.empty() ? problem.random_pose(random) : order[set.size()]);
      const auto numbers = static_cast<Eigen::Index>(set.size() + problem.measured.size()) * 6;
      if (numbers >= problem.information->unknowns() && figures_of(problem, set).full_rank) {
        least = set.size();
        break;
      }
    }
  }
  return least;
}

std::vector<double> random_fitness(const PlanProblem& problem, std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random = random_of(seed, 1);
  const Criterion criterion = problem.criterion();
  std::vector<double> out;
  for (std::size_t k = 0; k < count; ++k) {
    PoseSet set;
    if (problem.candidates.empty()) {
      while (set.size() < problem.poses) set.push_back(problem.random_pose(random));
    } else {
      PoseSet order = problem.candidates;
      for (std::size_t c = 0; c < problem.poses; ++c) {
        std::swap(order[c], order[c + below(order.size() - c, random)]);
        set.push_back(order[c]);
      }
    }
    const ExactFigures exact = figures_of(problem, set);
    out.push_back(exact.full_rank ? criterion.fitness(exact.figures)
                                  : std::numeric_limits<double>::infinity());
  }
  std::ranges::sort(out);
  return out;
}

PoseSet rounded(const PlanProblem& problem, const PoseSet& set) {
  if (!problem.candidates.empty()) return set;
  PoseSet out = set;
  for (PlannedPose& pose : out) {
    const Joints exact = pose.q_rad;
    bool found = false;
    for (const auto& [decimals, tries] : {std::pair{3, 200}, std::pair{6, 200}}) {
      std::mt19937_64 random = random_of(1, 2);
      const double unit = radians(std::pow(10, -decimals));
      for (int k = 0; k < tries && !found; ++k) {
        for (std::size_t j = 0; j < joint_count; ++j) {
          const double off = k == 0 ? 0 : 4 * (uniform(random) - 0.5);
          pose.q_rad[j] = rounded_angle(exact[j] + off * unit, decimals);
          // A limit with more decimals: the next value inside.
          if (pose.q_rad[j] > problem.limits[j].max_rad)
            pose.q_rad[j] = rounded_angle(exact[j] - unit, decimals);
          if (pose.q_rad[j] < problem.limits[j].min_rad)
            pose.q_rad[j] = rounded_angle(exact[j] + unit, decimals);
        }
        found = problem.allows(pose.q_rad);
      }
      if (found) break;
    }
    if (!found) pose.q_rad = exact;
  }
  return out;
}

double path_length(const PoseSet& set, const Speeds& speed_rad_s) {
  double sum = 0;
  for (std::size_t k = 1; k < set.size(); ++k) sum += distance(set[k - 1].q_rad, set[k].q_rad, speed_rad_s);
  return sum;
}

PoseSet in_order_of_travel(const PlanProblem& problem, const PoseSet& set, const Speeds& speed_rad_s) {
  std::vector<std::size_t> payloads(problem.payloads.size());
  std::iota(payloads.begin(), payloads.end(), std::size_t{0});
  std::ranges::stable_sort(payloads, [&](std::size_t a, std::size_t b) {
    return problem.payloads[a].payload_kg < problem.payloads[b].payload_kg;
  });
  PoseSet out;
  for (const std::size_t payload : payloads) {
    PoseSet group;
    for (const PlannedPose& p : set) {
      if (p.payload == payload) group.push_back(p);
    }
    if (group.empty()) continue;
    std::optional<Joints> from;
    if (!out.empty()) from = out.back().q_rad;
    const PoseSet path = short_path(group, from, speed_rad_s);
    out.insert(out.end(), path.begin(), path.end());
  }
  return out;
}

}  // namespace flexcomp::host
