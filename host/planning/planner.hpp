// SPDX-License-Identifier: Apache-2.0
/// \file
/// From a task to a list of poses that somebody can drive to: the methods by name, the least number of poses, what random
/// poses would give, rounding, and the order of travel.
#ifndef FLEXCOMP_HOST_PLANNING_PLANNER_HPP
#define FLEXCOMP_HOST_PLANNING_PLANNER_HPP

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "planning/search.hpp"

namespace flexcomp::host {

enum class Method { refine, exchange, detmax, sapso };

/// What `effort` 1 means: about a second of work for `refine` whatever the task; 200 restarts of exchange, or as many as
/// five million evaluations allow; ten of DETMAX; 600 motions of the swarm.
std::unique_ptr<Search> make_search(Method method, const PlanProblem& problem, double effort,
                                    std::uint64_t seed);

/// True where the method moves joints freely; the others choose among candidates.
bool moves_joints(Method method);

/// The smallest number of poses that, with what is known, makes every identifiable parameter known at all. Nothing where
/// no number does (of the candidates, or below 1,000).
std::optional<std::size_t> least_poses(const PlanProblem& problem, std::uint64_t seed);

/// The figures of known poses and these together, without any prior.
ExactFigures figures_of(const PlanProblem& problem, const PoseSet& set);

/// Fitness of `count` sets of random feasible poses, ascending.
std::vector<double> random_fitness(const PlanProblem& problem, std::size_t count, std::uint64_t seed);

/// Joints to a thousandth of a degree, and allowed still: rounded away from what stands in the way, and where no
/// neighbour is allowed to a millionth. Candidates stay as they are.
PoseSet rounded(const PlanProblem& problem, const PoseSet& set);

/// Grouped by payload, lightest first (a change of payload is what takes time), and within a group such that the slowest joint
/// travels little: nearest neighbour from every start, then 2-opt.
/// \param speed_rad_s  of each joint; where one is unknown (0) all count alike
PoseSet in_order_of_travel(const PlanProblem& problem, const PoseSet& set,
                           const std::array<double, joint_count>& speed_rad_s);

/// Length of the way through a set in its order: Σ of the largest joint motion over speed.
double way(const PoseSet& set, const std::array<double, joint_count>& speed_rad_s);

}  // namespace flexcomp::host

#endif
