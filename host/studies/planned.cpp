// SPDX-License-Identifier: Apache-2.0
#include "studies/planned.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include "model/cell.hpp"
#include "planning/feasibility.hpp"
#include "planning/planner.hpp"
#include "planning/sapso.hpp"

namespace flexcomp::host {

namespace {

/// Objective of Chen 33 with Chen 30 in its only possible reading for a simulation: squared errors of the least squares
/// estimate against the truth, in units, for one draw of noise, the same for all sets.
class OracleObjective {
 public:
  OracleObjective(const PlanProblem& problem, std::uint64_t seed) : problem_(problem) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    noise_.resize(problem.instrument.rows(), static_cast<Eigen::Index>(problem.poses));
    for (Eigen::Index k = 0; k < noise_.size(); ++k) noise_(k) = normal(random);
  }

  double operator()(const PoseSet& set) const {
    const std::vector<Block> blocks = problem_.blocks(set);
    const Information information = problem_.of(blocks);
    return errors(blocks, information).squaredNorm() / problem_.criterion().o1(information.figures());
  }

  /// Estimate minus truth in units.
  Eigen::VectorXd errors(const PoseSet& set) const {
    const std::vector<Block> blocks = problem_.blocks(set);
    return errors(blocks, problem_.of(blocks));
  }

 private:
  Eigen::VectorXd errors(const std::vector<Block>& blocks, const Information& information) const {
    Eigen::VectorXd right = Eigen::VectorXd::Zero(information.unknowns());
    for (std::size_t k = 0; k < blocks.size(); ++k)
      right += blocks[k] * noise_.col(static_cast<Eigen::Index>(k));
    return information.inverse() * right;
  }

  const PlanProblem& problem_;
  Eigen::MatrixXd noise_;
};

PlanProblem problem_of(const StudiedArm& arm, std::size_t count, const std::vector<double>& payloads_kg) {
  PlanProblem problem;
  problem.instrument = Instrument::pose(arm.robot.position_sigma_m, arm.robot.orientation_sigma_rad);
  for (const double payload :
       payloads_kg.empty() ? std::vector<double>{arm.robot.nominal.payload_kg} : payloads_kg) {
    problem.payloads.push_back(default_context<double>(arm.robot.nominal));
    problem.payloads.back().payload_kg = payload;
  }
  std::vector<PlannedMeasurement> like;
  for (const PoseContext& context : problem.payloads) like.push_back({{}, context, problem.instrument});
  problem.information = std::make_shared<PoseInformation>(arm.robot, ModelKind::full, false, like);
  problem.limits = arm.robot.nominal.limits;
  problem.poses = count;
  return problem;
}

/// Poses with the arm's own payload.
PoseSet set_of(const std::vector<StudiedPose>& poses) {
  PoseSet set;
  for (const StudiedPose& pose : poses) set.push_back({pose.q_rad, 0});
  return set;
}

}  // namespace

double criterion_of(const StudiedArm& arm, const std::vector<StudiedPose>& poses) {
  const PlanProblem problem = problem_of(arm, poses.size(), {});
  return problem.criterion().fitness(figures_of(problem, set_of(poses)).figures);
}

Eigen::VectorXd errors_at_the_chosen_draw(const StudiedArm& arm, const std::vector<StudiedPose>& poses,
                                          std::uint64_t seed, const std::vector<Parameter>& parameters) {
  const PlanProblem problem = problem_of(arm, poses.size(), {});
  const Eigen::VectorXd in_units = OracleObjective(problem, seed).errors(set_of(poses));
  const std::vector<std::string>& names = problem.information->names();
  Eigen::VectorXd errors(static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    const auto at = static_cast<std::size_t>(std::ranges::find(names, parameters[p].name) - names.begin());
    errors[static_cast<Eigen::Index>(p)] = in_units[static_cast<Eigen::Index>(at)] *
                                           problem.information->file_units()[at] *
                                           parameters[p].si_per_file_unit();
  }
  return errors;
}

std::vector<StudiedPose> planned_poses(const StudiedArm& arm, std::size_t count, Planning how,
                                       std::uint64_t seed, const std::vector<double>& payloads_kg) {
  Cell cell;
  cell.tracker_m = Eigen::Vector3d(2.5, 0, 0.3);
  const Feasibility feasibility(arm.robot, cell);
  PlanProblem problem = problem_of(arm, count, payloads_kg);
  problem.feasible = [&](const Joints& q) { return feasibility.allows(q); };

  std::unique_ptr<Search> search;
  switch (how) {
    case Planning::random:
      break;
    case Planning::detmax:
      search = make_search(Method::detmax, problem, 1, seed);
      break;
    case Planning::sapso: {
      SapsoOptions options;
      options.seed = seed;
      options.objective = OracleObjective(problem, seed);
      search = std::make_unique<SapsoSearch>(problem, options);
      break;
    }
    case Planning::sapso_expected:
      search = make_search(Method::sapso, problem, 1, seed);
      break;
    case Planning::ours:
      search = make_search(Method::refine, problem, 1, seed);
      break;
  }
  PoseSet set;
  if (search) {
    while (!search->done()) search->step();
    set = search->best();
  } else {
    std::mt19937_64 random = random_of(seed, 0);
    for (std::size_t k = 0; k < count; ++k) set.push_back(problem.random_pose(random));
  }
  std::vector<StudiedPose> poses;
  for (const PlannedPose& pose : set)
    poses.push_back({pose.q_rad, problem.payloads[pose.payload].payload_kg});
  return poses;
}

}  // namespace flexcomp::host
