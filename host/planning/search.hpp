// SPDX-License-Identifier: Apache-2.0
/// \file The planning problem, and the interface of all search methods: steps with progress, state that is
/// saved and restored.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "json.hpp"
#include "planning/criterion.hpp"
#include "planning/pose_information.hpp"

namespace flexcomp::host {

/// A planned pose: joint positions and index of its payload.
struct PlannedPose {
  Joints q_rad{};
  std::size_t payload = 0;
};
using PoseSet = std::vector<PlannedPose>;

struct PlanProblem {
  std::shared_ptr<const PoseInformation> information;
  Instrument instrument = Instrument::position(1);
  std::vector<PoseContext> payloads;  ///< contexts that differ in their payload; one or more
  std::array<JointLimits, joint_count> limits{};
  std::function<bool(const Joints&)> feasible;  ///< beyond the limits; empty: all poses are
  PoseSet candidates;                           ///< only these, each once; empty: anything within the limits
  std::size_t poses = 0;                        ///< how many to choose
  std::vector<Block> measured;                  ///< of poses measured already, see set_measured()
  Eigen::MatrixXd measured_sum;                 ///< Σ HHᵀ of them

  Criterion criterion(Goal goal = Goal::dual) const;
  void block(const PlannedPose& pose, Block& out) const;
  Block block(const PlannedPose& pose) const;
  std::vector<Block> blocks(const PoseSet& set) const;
  bool allows(const Joints& q_rad) const;  ///< within the limits and feasible
  void set_measured(std::vector<Block> blocks);
  /// Information matrix of the measured poses and these blocks, with a weak prior (10,000 units) that makes
  /// sets of too few poses comparable.
  Information of(const std::vector<Block>& blocks) const;
  double log_fitness(const PoseSet& set) const;

  /// Random feasible pose, uniform within the limits, with a random payload; or a random candidate.
  /// \throws std::runtime_error  after a million infeasible poses
  PlannedPose random_pose(std::mt19937_64& random) const;
};

/// Uniform random number in [0, 1).
double uniform(std::mt19937_64& random);
/// Uniform random index below `count`.
std::size_t below(std::size_t count, std::mt19937_64& random);
/// Random engine of step `index` of a search with this seed: each step can be repeated by itself.
std::mt19937_64 random_of(std::uint64_t seed, std::uint64_t index);

/// A search method applied to one problem.
class Search {
 public:
  explicit Search(const PlanProblem& problem) : problem_(problem) {}
  virtual ~Search() = default;
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;

  /// One step of the search; does nothing where it is done().
  virtual void step() = 0;
  virtual double progress() const = 0;  ///< share of the work that is done, 0 … 1
  bool done() const { return progress() >= 1; }

  const PoseSet& best() const { return best_; }               ///< empty before the first step
  double best_log_fitness() const { return best_log_; }       ///< of the dual index, for every method
  std::uint64_t evaluations() const { return evaluations_; }  ///< poses whose H or gain was computed
  /// Evaluations and log fitness at each improvement.
  const std::vector<std::pair<std::uint64_t, double>>& history() const { return history_; }

  /// Complete state: a search that loads it continues exactly as if it had not been interrupted.
  Json save() const;
  /// \throws Json::exception, std::runtime_error  where the state does not fit
  void load(const Json& state);

 protected:
  virtual void save_own(Json& state) const = 0;
  virtual void load_own(const Json& state) = 0;
  /// Replaces the best set where this one is better.
  bool offer(const PoseSet& set, double log_fitness);
  /// Replaces the best set: for a method with another objective.
  void replace_best(const PoseSet& set, double log_fitness);

  const PlanProblem& problem_;
  std::uint64_t evaluations_ = 0;

 private:
  PoseSet best_;
  double best_log_ = std::numeric_limits<double>::infinity();
  std::vector<std::pair<std::uint64_t, double>> history_;
};

/// Joint positions, rad, and payload index of each pose.
Json to_json(const PoseSet& set);
/// Inverse of to_json(). \throws Json::exception, std::runtime_error  where it is no set of this problem
PoseSet pose_set_of(const Json& json, const PlanProblem& problem);

}  // namespace flexcomp::host
