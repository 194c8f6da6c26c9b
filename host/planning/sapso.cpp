// SPDX-License-Identifier: Apache-2.0
#include "planning/sapso.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "json.hpp"

namespace flexcomp::host {

double adaptive_inertia(double f, double f_min, double f_avg, double w_min, double w_max) {
  if (!(f <= f_avg)) return w_max;
  return f_avg > f_min ? w_min + (w_max - w_min) * (f - f_min) / (f_avg - f_min) : w_min;
}

void SapsoSearch::evaluate(Particle& particle) {
  particle.value =
      options_.objective ? options_.objective(particle.at) : std::exp(problem_.log_fitness(particle.at));
  evaluations_ += particle.at.size();
}

/// Moves a particle by its velocity. A joint stops at its limit; a pose that would be infeasible stays, with
/// velocity 0.
void SapsoSearch::move(Particle& particle, double inertia, const PoseSet& lead,
                       std::mt19937_64& random) const {
  for (std::size_t k = 0; k < particle.at.size(); ++k) {
    PlannedPose next = particle.at[k];
    Joints speed{};
    for (std::size_t j = 0; j < joint_count; ++j) {
      const JointLimits& limits = problem_.limits[j];
      const double q = particle.at[k].q_rad[j];
      const double r1 = uniform(random);
      const double r2 = uniform(random);
      const double most = options_.largest_speed * (limits.max_rad - limits.min_rad);
      speed[j] =
          std::clamp(inertia * particle.speed[k][j] + options_.own * r1 * (particle.best[k].q_rad[j] - q) +
                         options_.swarm * r2 * (lead[k].q_rad[j] - q),
                     -most, most);
      next.q_rad[j] = std::clamp(q + speed[j], limits.min_rad, limits.max_rad);
      speed[j] = next.q_rad[j] - q;
    }
    // The payload index is discrete: copied from one of the bests, or random.
    if (problem_.payloads.size() > 1) {
      const double choice = uniform(random);
      if (choice < 0.1)
        next.payload = below(problem_.payloads.size(), random);
      else if (choice < 0.3)
        next.payload = particle.best[k].payload;
      else if (choice < 0.5)
        next.payload = lead[k].payload;
    }
    if (problem_.feasible && !problem_.feasible(next.q_rad)) {
      particle.speed[k] = Joints{};
      continue;
    }
    particle.at[k] = next;
    particle.speed[k] = speed;
  }
}

void SapsoSearch::step() {
  if (done()) return;
  std::mt19937_64 random = random_of(options_.seed, next_++);
  if (swarm_.empty()) {
    swarm_.resize(options_.particles);
    for (Particle& p : swarm_) {
      for (std::size_t k = 0; k < problem_.poses; ++k) p.at.push_back(problem_.random_pose(random));
      p.speed.resize(problem_.poses);
      evaluate(p);
      p.best = p.at;
      p.best_value = p.value;
    }
  } else {
    double least = std::numeric_limits<double>::infinity();
    double sum = 0;
    for (const Particle& p : swarm_) {
      least = std::min(least, p.value);
      sum += p.value;
    }
    const double average = sum / static_cast<double>(swarm_.size());
    const PoseSet lead = swarm_[leader_].best;
    for (Particle& p : swarm_) {
      const double inertia =
          adaptive_inertia(p.value, least, average, options_.least_inertia, options_.largest_inertia);
      move(p, inertia, lead, random);
      evaluate(p);
      if (p.value < p.best_value) {
        p.best = p.at;
        p.best_value = p.value;
      }
    }
  }
  leader_ =
      static_cast<std::size_t>(std::ranges::min_element(swarm_, {}, &Particle::best_value) - swarm_.begin());
  offer(swarm_[leader_].best, std::log(swarm_[leader_].best_value));
}

void SapsoSearch::save_own(Json& state) const {
  state["step"] = next_;
  state["leader"] = leader_;
  Json& swarm = state["swarm"] = Json::array();
  for (const Particle& p : swarm_) {
    swarm.push_back({{"at", to_json(p.at)},
                     {"speed", p.speed},
                     {"best", to_json(p.best)},
                     {"value", p.value},
                     {"best_value", p.best_value}});
  }
}

void SapsoSearch::load_own(const Json& state) {
  next_ = state.at("step").get<std::uint64_t>();
  leader_ = state.at("leader").get<std::size_t>();
  swarm_.clear();
  for (const Json& p : state.at("swarm")) {
    swarm_.push_back({pose_set_of(p.at("at"), problem_), p.at("speed").get<std::vector<Joints>>(),
                      pose_set_of(p.at("best"), problem_), p.at("value").get<double>(),
                      p.at("best_value").get<double>()});
    if (swarm_.back().speed.size() != problem_.poses) throw std::runtime_error("another number of poses");
  }
  if (leader_ >= std::max<std::size_t>(swarm_.size(), 1))
    throw std::runtime_error("a leader that is not there");
}

}  // namespace flexcomp::host
