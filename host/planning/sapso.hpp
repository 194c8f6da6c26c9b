// SPDX-License-Identifier: Apache-2.0
/// \file
/// Particle swarm with self-adaptive inertia (Chen et al. 2019, Eq. 33-35): every particle is a whole set of poses.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "json.hpp"
#include "planning/search.hpp"

namespace flexcomp::host {

/// Inertia of a particle with objective f, Eq. (M47): least for the best, which then converge. Chen 35 prints
/// w_min - (w_max - w_min)(f - f_min)/(f_avg - f_min), which leaves [w_min, w_max]; here the sign is a plus.
double adaptive_inertia(double f, double f_min, double f_avg, double w_min, double w_max);

struct SapsoOptions {
  std::size_t particles = 500;
  std::uint64_t iterations = 600;
  double own = 2;    ///< c1, weight of the particle's own best
  double swarm = 2;  ///< c2, weight of the swarm's best
  double least_inertia = 0.5;
  double largest_inertia = 0.8;
  /// Largest step of a joint in one iteration, as a share of its range: c1 = c2 = 2 does not converge by itself.
  double largest_speed = 0.05;
  std::uint64_t seed = 1;
  /// Objective; empty: the dual index with Omin in expectation. The studies set the form of Chen 30, with the true
  /// parameters. best_log_fitness() is then the logarithm of this objective.
  std::function<double(const PoseSet&)> objective = {};
};

/// Each step is one iteration of the swarm.
class SapsoSearch : public Search {
 public:
  SapsoSearch(const PlanProblem& problem, const SapsoOptions& options) : Search(problem), options_(options) {}
  void step() override;
  double progress() const override {
    return static_cast<double>(next_) / static_cast<double>(options_.iterations + 1);
  }

 protected:
  void save_own(Json& state) const override;
  void load_own(const Json& state) override;

 private:
  struct Particle {
    PoseSet at;
    std::vector<Joints> speed;
    PoseSet best;
    double value = 0;
    double best_value = 0;
  };
  void evaluate(Particle& particle);
  void move(Particle& particle, double inertia, const PoseSet& lead, std::mt19937_64& random) const;

  SapsoOptions options_;
  std::uint64_t next_ = 0;
  std::vector<Particle> swarm_;
  std::size_t leader_ = 0;
};

}  // namespace flexcomp::host
