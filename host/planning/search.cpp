// SPDX-License-Identifier: Apache-2.0
#include "planning/search.hpp"

#include <stdexcept>
#include <utility>

#include "json.hpp"

namespace flexcomp::host {

namespace {

/// Precision of a standard deviation of 10,000 units (1 m, 500 degrees): negligible, but M is invertible.
constexpr double weak_prior = 1e-8;

}  // namespace

Criterion PlanProblem::criterion(Goal goal) const {
  return {information->parameters(), static_cast<double>(poses + measured.size()), goal};
}

void PlanProblem::block(const PlannedPose& pose, Block& out) const {
  information->block(pose.q_rad, payloads[pose.payload], instrument, out);
}

Block PlanProblem::block(const PlannedPose& pose) const {
  Block h;
  block(pose, h);
  return h;
}

std::vector<Block> PlanProblem::blocks(const PoseSet& set) const {
  std::vector<Block> out(set.size());
  for (std::size_t k = 0; k < set.size(); ++k) block(set[k], out[k]);
  return out;
}

bool PlanProblem::allows(const Joints& q_rad) const {
  for (std::size_t j = 0; j < joint_count; ++j) {
    if (!(q_rad[j] >= limits[j].min_rad && q_rad[j] <= limits[j].max_rad)) return false;
  }
  return !feasible || feasible(q_rad);
}

void PlanProblem::set_measured(std::vector<Block> blocks) {
  measured = std::move(blocks);
  measured_sum = sum_of_squares(measured, information->unknowns());
}

Information PlanProblem::of(const std::vector<Block>& blocks) const {
  Information out(information->nuisance(), information->parameters(), weak_prior);
  Eigen::MatrixXd m = sum_of_squares(blocks, information->unknowns());
  if (!measured.empty()) m += measured_sum;
  out.assign(m);
  return out;
}

double PlanProblem::log_fitness(const PoseSet& set) const {
  return criterion().log_score(of(blocks(set)).figures());
}

PlannedPose PlanProblem::random_pose(std::mt19937_64& random) const {
  constexpr int most = 1000000;
  PlannedPose pose;
  if (!candidates.empty()) return candidates[below(candidates.size(), random)];
  for (int k = 0; k < most; ++k) {
    for (std::size_t j = 0; j < joint_count; ++j) {
      pose.q_rad[j] = limits[j].min_rad + (limits[j].max_rad - limits[j].min_rad) * uniform(random);
    }
    if (!feasible || feasible(pose.q_rad)) {
      pose.payload = below(payloads.size(), random);
      return pose;
    }
  }
  throw std::runtime_error("none of 1,000,000 random poses is allowed");
}

double uniform(std::mt19937_64& random) { return static_cast<double>(random() >> 11U) * 0x1.0p-53; }

std::size_t below(std::size_t count, std::mt19937_64& random) {
  return static_cast<std::size_t>(uniform(random) * static_cast<double>(count));
}

std::mt19937_64 random_of(std::uint64_t seed, std::uint64_t index) {
  std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U),
                         static_cast<std::uint32_t>(index), static_cast<std::uint32_t>(index >> 32U)};
  return std::mt19937_64(sequence);
}

bool Search::offer(const PoseSet& set, double log_fitness) {
  if (!(log_fitness < best_log_)) return false;
  replace_best(set, log_fitness);
  return true;
}

void Search::replace_best(const PoseSet& set, double log_fitness) {
  best_ = set;
  best_log_ = log_fitness;
  history_.emplace_back(evaluations_, log_fitness);
}

Json to_json(const PoseSet& set) {
  Json out = Json::array();
  for (const PlannedPose& p : set) out.push_back({p.q_rad, p.payload});
  return out;
}

PoseSet pose_set_of(const Json& json, const PlanProblem& problem) {
  PoseSet set;
  for (const Json& p : json) set.push_back({p.at(0).get<Joints>(), p.at(1).get<std::size_t>()});
  if (set.size() != problem.poses) throw std::runtime_error("another number of poses");
  for (const PlannedPose& p : set) {
    if (p.payload >= problem.payloads.size()) throw std::runtime_error("a payload that is not there");
    if (!problem.allows(p.q_rad)) throw std::runtime_error("a pose that cannot be taken");
  }
  return set;
}

Json Search::save() const {
  Json state{{"evaluations", evaluations_}, {"history", history_}};
  if (!best_.empty()) {
    state["best"] = to_json(best_);
    state["log_fitness"] = best_log_;
  }
  save_own(state);
  return state;
}

void Search::load(const Json& state) {
  evaluations_ = state.at("evaluations").get<std::uint64_t>();
  history_ = state.at("history").get<std::vector<std::pair<std::uint64_t, double>>>();
  if (state.contains("best")) {
    best_ = pose_set_of(state.at("best"), problem_);
    best_log_ = state.at("log_fitness").get<double>();
  }
  load_own(state);
}

}  // namespace flexcomp::host
