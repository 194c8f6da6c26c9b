// SPDX-License-Identifier: Apache-2.0
/// \file
/// What measurement poses are planned for: robot, cell, instrument, what is measured already, candidates and payloads,
/// as the problem that a search solves.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "measurement/measured_data.hpp"
#include "planning/feasibility.hpp"
#include "planning/planner.hpp"

namespace flexcomp::host {

struct PlanSettings {
  std::size_t poses = 0;                   ///< to choose
  std::optional<Method> method;            ///< default: refine, among candidates exchange
  std::optional<MeasurementKind> measure;  ///< default: as the data measured already, else pose
  ModelKind model = ModelKind::full;
  bool fit_frames = false;
  std::vector<double> payloads_kg;  ///< to choose from at each pose; default: the robot file's
  double effort = 1;                ///< see make_search()
  std::uint64_t seed = 1;
};

/// Random poses that estimate the share of the joint space that is feasible.
constexpr std::size_t feasibility_samples = 10000;

/// A planning problem with the files that it came from. Stays where it is made: the problem refers to it.
class PlanTask {
 public:
  /// \param candidates  joint readings to choose from, with their payloads where the file has them
  /// \param measured    poses measured already, with or without measurements
  /// \throws InputError     no pose is feasible, reflectors that are missing or collinear, too few feasible candidates,
  ///                        parameters that no number of poses makes identifiable
  /// \throws ArgumentError  too_few_poses
  PlanTask(const Robot& robot, std::optional<Cell> cell, const PlanSettings& settings,
           const std::optional<MeasuredData>& candidates, const std::optional<MeasuredData>& measured);
  PlanTask(const PlanTask&) = delete;
  PlanTask& operator=(const PlanTask&) = delete;

  Robot robot;
  std::optional<Cell> cell;
  PlanSettings settings;
  Method method = Method::refine;
  MeasurementKind measure = MeasurementKind::pose;
  std::string candidates_file;  ///< empty: none
  std::string measured_file;    ///< empty: none
  PlanProblem problem;
  std::vector<PlannedMeasurement> known;
  bool payload_column = false;  ///< the plan says which payload each pose has
  std::vector<std::string> warnings;
  double feasible_share = 0;                 ///< of poses within the joint limits
  std::map<Obstruction, double> obstructed;  ///< share by the obstruction found first

 private:
  Instrument instrument(MeasurementKind kind, std::size_t reflectors, double position_sigma_m,
                        double orientation_sigma_rad) const;
  void take_measured(const std::optional<MeasuredData>& measured);
  void take_candidates(const MeasuredData& candidates);
  void sample_feasibility();
  void check_number();

  Feasibility feasibility_;
  std::vector<Eigen::Vector3d> reflectors_m_;  ///< of the robot file, else estimated from the data
};

}  // namespace flexcomp::host
