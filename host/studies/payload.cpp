// SPDX-License-Identifier: Apache-2.0
// Gain of the flexible model over the payload: the paper says that it grows.
#include <fmt/format.h>

#include "studies/calibrations.hpp"
#include "studies/planned.hpp"
#include "studies/study.hpp"

namespace flexcomp::host {

namespace {

/// Mean true position error on other poses over repeated calibrations, m.
double mean_residual_m(const StudiedArm& arm, const Experiment& experiment,
                       const std::vector<Observation>& others, const StudyOptions& options) {
  std::vector<double> residual(options.repeats);
  for_each_repeat(options.repeats, [&](std::size_t k) {
    const TermSet terms = experiment.calibrate((options.seed << 32) + k).set;
    for (const Eigen::Vector3d& error : position_errors_m(arm, terms, others))
      residual[k] += error.norm() / static_cast<double>(others.size());
  });
  double sum = 0;
  for (const double v : residual) sum += v / static_cast<double>(options.repeats);
  return sum;
}

}  // namespace

Study study_payload(const StudyOptions& options) {
  Study study{"payload",
              "Gain of the flexible model over the payload",
              "mean score of the parameters (1 is perfect)",
              {"arm", "noise", "payload [kg]", "rigid-flexible [mm]", "geometric [mm]", "gain"}};
  for (const StudiedArm& given : options.arms) {
    Curves curves{.described = "Mean error on other poses over the payload, " + given.name,
                  .x_name = "payload [kg]",
                  .y_name = "mm",
                  .log_y = true};
    for (const NoiseLevel& noise : options.noises) {
      Curve flexible{fmt::format("{} rigid-flexible", noise.name)};
      Curve rigid{fmt::format("{} geometric", noise.name)};
      double done = 0;
      for (const double payload : {0.5, 1.1, 3.0, 5.0}) {
        options.report(fmt::format("{} {}: {} kg", given.name, noise.name, payload), done++ / 4);
        StudiedArm arm = given;
        arm.robot.nominal.payload_kg = payload;
        const std::vector<StudiedPose> poses = planned_poses(arm, 14, Planning::ours, options.seed);
        const std::vector<Observation> others =
            clean_rows(arm, random_poses(arm, 100, options.seed + 1000), true, noise);
        ExperimentOptions how{.method = Estimation::ours, .noise = noise, .fit_all = true};
        const Experiment full(arm, poses, how);
        how.model = ModelKind::geometric;
        const Experiment geometric(arm, poses, how);
        const Score score = repeated_score(full, options.repeats, options.seed);
        const double full_mm = mean_residual_m(arm, full, others, options) * 1e3;
        const double geometric_mm = mean_residual_m(arm, geometric, others, options) * 1e3;
        study.rows.push_back(
            {.labels = {arm.name, noise.name, fmt::format("{:g}", payload), fmt::format("{:.4f}", full_mm),
                        fmt::format("{:.4f}", geometric_mm), fmt::format("{:.2f}", geometric_mm / full_mm)},
             .ours = score.mean,
             .uncertainty = score.error_of_mean(),
             .limit = full.cramer_rao_score()});
        flexible.points.push_back({payload, full_mm});
        rigid.points.push_back({payload, geometric_mm});
      }
      curves.curves.push_back(rigid);
      curves.curves.push_back(flexible);
    }
    study.figures.push_back({given.name + ": true error on 100 other poses.", curves});
    study.notes.push_back(given.about);
  }
  study.notes.push_back(
      "14 planned poses for each payload. mm: mean true position error on 100 other poses with the same "
      "payload; gain: error of the geometric model over that of the flexible one. The paper says that the "
      "gain "
      "grows with the payload, and prints no figures.");
  return study;
}

}  // namespace flexcomp::host
