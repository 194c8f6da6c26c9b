// SPDX-License-Identifier: Apache-2.0
#include "planning/refine.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include "json.hpp"
#include "planning/exchange.hpp"

namespace flexcomp::host {

namespace {

constexpr Eigen::Index joints = static_cast<Eigen::Index>(joint_count);
/// Step of the difference quotient of H, rad: rounding and curvature both stay below 1e-6 of the derivative.
constexpr double difference_rad = 1e-6;

/// Log fitness of a set and its gradient over all joint positions.
double value_and_gradient(const PlanProblem& problem, const Criterion& criterion, const PoseSet& set,
                          const std::vector<Block>& blocks, Eigen::VectorXd& gradient,
                          std::uint64_t& evaluations) {
  const Information information = problem.of(blocks);
  const Eigen::MatrixXd w = information.gradient(criterion);
  gradient.resize(joints * static_cast<Eigen::Index>(set.size()));
  Block moved;
  Block wh;
  for (std::size_t k = 0; k < set.size(); ++k) {
    // d log score = 2 tr(Hᵀ W dH)
    wh.resize(blocks[k].rows(), blocks[k].cols());
    wh.noalias() = w * blocks[k];
    for (std::size_t j = 0; j < joint_count; ++j) {
      PlannedPose p = set[k];
      p.q_rad[j] += difference_rad;
      problem.block(p, moved);
      gradient[joints * static_cast<Eigen::Index>(k) + static_cast<Eigen::Index>(j)] =
          2 * wh.cwiseProduct(moved - blocks[k]).sum() / difference_rad;
    }
  }
  evaluations += set.size() * (joint_count + 2);
  return criterion.log_score(information.figures());
}

/// Direction of limited-memory BFGS (Nocedal and Wright, algorithm 7.4) on the free joints.
Eigen::VectorXd quasi_newton(const std::deque<std::pair<Eigen::VectorXd, Eigen::VectorXd>>& steps,
                             const Eigen::VectorXd& gradient, const Eigen::VectorXd& free) {
  Eigen::VectorXd d = -gradient.cwiseProduct(free);
  std::vector<double> alpha(steps.size());
  for (std::size_t k = steps.size(); k-- > 0;) {
    const auto& [s, y] = steps[k];
    alpha[k] = s.dot(d) / s.dot(y);
    d -= alpha[k] * y;
  }
  if (!steps.empty()) {
    const auto& [s, y] = steps.back();
    d *= s.dot(y) / y.squaredNorm();
  }
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const auto& [s, y] = steps[k];
    d += (alpha[k] - y.dot(d) / s.dot(y)) * s;
  }
  return d.cwiseProduct(free);
}

/// 1 for joints that may move, 0 for those at a limit against which the gradient pushes.
Eigen::VectorXd free_joints(const PlanProblem& problem, const PoseSet& set, const Eigen::VectorXd& gradient) {
  Eigen::VectorXd free = Eigen::VectorXd::Ones(gradient.size());
  for (Eigen::Index i = 0; i < free.size(); ++i) {
    const double q = set[static_cast<std::size_t>(i / joints)].q_rad[static_cast<std::size_t>(i % joints)];
    const JointLimits& limits = problem.limits[static_cast<std::size_t>(i % joints)];
    if ((q <= limits.min_rad && gradient[i] > 0) || (q >= limits.max_rad && gradient[i] < 0)) free[i] = 0;
  }
  return free;
}

/// Moves a set by t * direction inside the limits and returns the slope: gradient times motion. A pose whose
/// step is not feasible takes a shorter one, or stays.
double step_along(const PlanProblem& problem, const PoseSet& set, const Eigen::VectorXd& direction,
                  const Eigen::VectorXd& gradient, double t, PoseSet& moved) {
  moved = set;
  double slope = 0;
  for (std::size_t k = 0; k < set.size(); ++k) {
    const Eigen::Index first = joints * static_cast<Eigen::Index>(k);
    double own = t;
    for (int shorter = 0;; ++shorter, own /= 4) {
      for (std::size_t j = 0; j < joint_count; ++j) {
        moved[k].q_rad[j] =
            std::clamp(set[k].q_rad[j] + own * direction[first + static_cast<Eigen::Index>(j)],
                       problem.limits[j].min_rad, problem.limits[j].max_rad);
      }
      if (!problem.feasible || problem.feasible(moved[k].q_rad)) break;
      if (shorter == 3) {
        moved[k] = set[k];
        break;
      }
    }
    for (std::size_t j = 0; j < joint_count; ++j) {
      slope += gradient[first + static_cast<Eigen::Index>(j)] * (moved[k].q_rad[j] - set[k].q_rad[j]);
    }
  }
  return slope;
}

}  // namespace

double descend(const PlanProblem& problem, PoseSet& set, int most_steps, double tolerance,
               std::uint64_t& evaluations) {
  constexpr std::size_t memory = 12;
  constexpr double longest_step_rad = 0.5;
  const Criterion criterion = problem.criterion();
  const auto n = static_cast<Eigen::Index>(set.size());
  std::vector<Block> blocks = problem.blocks(set);
  Eigen::VectorXd gradient;
  double value = value_and_gradient(problem, criterion, set, blocks, gradient, evaluations);
  std::deque<std::pair<Eigen::VectorXd, Eigen::VectorXd>> steps;
  int small = 0;
  for (int iteration = 0; iteration < most_steps; ++iteration) {
    const Eigen::VectorXd free = free_joints(problem, set, gradient);
    Eigen::VectorXd direction = quasi_newton(steps, gradient, free);
    if (!(direction.dot(gradient) < 0)) {
      steps.clear();
      direction = -gradient.cwiseProduct(free);
    }
    const double largest = direction.cwiseAbs().maxCoeff();
    if (!(largest > 0)) break;
    double t = std::min(1.0, longest_step_rad / largest);
    if (steps.empty()) t = std::min(t, 0.1 / largest);

    PoseSet trial;
    std::vector<Block> trial_blocks(set.size());
    bool accepted = false;
    for (int halving = 0; halving < 12 && !accepted; ++halving, t /= 2) {
      const double slope = step_along(problem, set, direction, gradient, t, trial);
      for (std::size_t k = 0; k < set.size(); ++k) problem.block(trial[k], trial_blocks[k]);
      evaluations += set.size();
      accepted = slope < 0 && criterion.log_score(problem.of(trial_blocks).figures()) <= value + 1e-4 * slope;
    }
    if (!accepted) {
      if (steps.empty()) break;
      steps.clear();
      continue;
    }
    Eigen::VectorXd s(joints * n);
    for (Eigen::Index i = 0; i < s.size(); ++i) {
      const auto k = static_cast<std::size_t>(i / joints);
      const auto j = static_cast<std::size_t>(i % joints);
      s[i] = trial[k].q_rad[j] - set[k].q_rad[j];
    }
    const Eigen::VectorXd before = gradient;
    const double value_before = value;
    set = trial;
    blocks = trial_blocks;
    value = value_and_gradient(problem, criterion, set, blocks, gradient, evaluations);
    const Eigen::VectorXd y = gradient - before;
    if (s.dot(y) > 1e-10 * s.norm() * y.norm()) {
      steps.emplace_back(s, y);
      if (steps.size() > memory) steps.pop_front();
    }
    small = value_before - value < tolerance ? small + 1 : 0;
    if (small >= 3) break;
  }
  return value;
}

void RefineSearch::step() {
  if (done()) return;
  std::mt19937_64 random = random_of(options_.seed, next_++);
  if (current_.empty()) {
    const CandidatePool pool = make_pool(problem_, options_.candidates, random);
    std::vector<std::size_t> chosen = random_choice(pool, problem_.poses, random);
    exchange(problem_, pool, problem_.criterion(), chosen, evaluations_, 4);
    current_ = poses_of(pool, chosen);
    current_log_ = descend(problem_, current_, 100, 1e-4, evaluations_);
    offer(current_, current_log_);
    return;
  }
  // Replace one pose by the best of some random ones, then descend again.
  PoseSet trial = current_;
  const std::size_t k = below(trial.size(), random);
  const Criterion criterion = problem_.criterion();
  Information rest = problem_.of(problem_.blocks(trial));
  rest.remove(problem_.block(trial[k]));
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t r = 0; r < options_.replacements; ++r) {
    const PlannedPose p = problem_.random_pose(random);
    const double score = criterion.log_score(rest.with(problem_.block(p)));
    if (score < least) {
      least = score;
      trial[k] = p;
    }
  }
  evaluations_ += options_.replacements;
  const double value = descend(problem_, trial, 30, 1e-4, evaluations_);
  if (value < current_log_) {
    current_ = trial;
    current_log_ = value;
    offer(current_, current_log_);
  }
}

void RefineSearch::save_own(Json& state) const {
  state["step"] = next_;
  state["now"] = to_json(current_);
  state["now_log"] = current_log_;
}

void RefineSearch::load_own(const Json& state) {
  next_ = state.at("step").get<std::uint64_t>();
  current_.clear();
  if (!state.at("now").empty()) current_ = pose_set_of(state.at("now"), problem_);
  current_log_ = state.at("now_log").get<double>();
}

}  // namespace flexcomp::host
