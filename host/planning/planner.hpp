// SPDX-License-Identifier: Apache-2.0
/// \file
/// Plans measurement poses: methods by name, least number of poses, random reference sets, rounding, order of travel.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "planning/search.hpp"

namespace flexcomp::host {

enum class Method { refine, exchange, detmax, sapso };
inline const std::map<std::string, Method> planning_methods{{"refine", Method::refine},
                                                            {"exchange", Method::exchange},
                                                            {"detmax", Method::detmax},
                                                            {"sapso", Method::sapso}};

/// What `effort` 1 means: about a second of work for `refine` whatever the task; 200 restarts of exchange, or as many as
/// five million evaluations allow; ten of DETMAX; 600 motions of the swarm.
std::unique_ptr<Search> make_search(Method method, const PlanProblem& problem, double effort,
                                    std::uint64_t seed);

/// True where the method moves joints freely; the others choose among candidates.
bool moves_joints(Method method);

/// Least number of poses that, with those measured already, identifies every identifiable parameter. Nothing where the
/// candidates, or 1,000 random poses, do not.
std::optional<std::size_t> least_poses(const PlanProblem& problem, std::uint64_t seed);

/// Criteria of the measured poses and these together, without a prior.
ExactFigures figures_of(const PlanProblem& problem, const PoseSet& set);

/// Fitness of `count` sets of random feasible poses, ascending.
std::vector<double> random_fitness(const PlanProblem& problem, std::size_t count, std::uint64_t seed);

/// Rounds joint positions to 0.001 degrees such that the pose stays feasible: away from the obstruction, and where no
/// rounded neighbour is feasible to 1e-6 degrees. Candidates stay as they are.
PoseSet rounded(const PlanProblem& problem, const PoseSet& set);

/// Orders a set for travel: by payload, lightest first, then a short path by nearest neighbour from every start
/// and 2-opt.
/// \param speed_rad_s  of each joint; where one is unknown (0) all have the same weight
PoseSet in_order_of_travel(const PlanProblem& problem, const PoseSet& set,
                           const std::array<double, joint_count>& speed_rad_s);

/// Travel time through a set in its order, s: sum of the largest joint motion over speed.
double path_length(const PoseSet& set, const std::array<double, joint_count>& speed_rad_s);

}  // namespace flexcomp::host
