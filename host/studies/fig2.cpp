// SPDX-License-Identifier: Apache-2.0
// Fig. 2: 30 random poses, Table 1's joint angle deviations alone and link length deviations alone.
#include <fmt/format.h>

#include "studies/study.hpp"

namespace flexcomp::host {

Study study_fig2(const StudyOptions& options) {
  Study study{"fig2",
              "Fig. 2: which deviations matter",
              "mean position error over 30 random poses [mm]",
              {"arm", "deviations", "times Table 1"}};
  for (const StudiedArm& arm : options.arms) {
    const std::vector<StudiedPose> poses = random_poses(arm, 30, options.seed);
    Curves curves{
        .described = "Position errors at 30 poses by kind and size of the deviations of " + arm.name,
        .x_name = "pose",
        .y_name = "mm",
        .log_y = true};
    double ratio = 0;
    for (const double factor : {1.0, 10.0, 100.0}) {
      double means[2] = {0, 0};
      for (const ErrorKind kind : {ErrorKind::joint_angles, ErrorKind::link_lengths}) {
        const std::vector<double> errors = errors_before_m(arm, part_of_table1(arm, kind, factor), poses);
        const bool angles = kind == ErrorKind::joint_angles;
        Curve curve{fmt::format("{} × {:g}", angles ? "Δθ" : "Δd", factor)};
        double& mean = means[angles ? 0 : 1];
        for (std::size_t k = 0; k < errors.size(); ++k) {
          const double mm = 1e3 * errors[k];
          mean += mm / static_cast<double>(errors.size());
          curve.points.push_back({static_cast<double>(k + 1), mm});
        }
        curves.curves.push_back(curve);
        study.rows.push_back(
            {.labels = {arm.name, angles ? "joint angles" : "link lengths d", fmt::format("{:g}", factor)},
             .ours = mean});
      }
      if (factor == 1) ratio = means[0] / means[1];
    }
    study.figures.push_back({arm.name + ": every pose.", curves});
    study.notes.push_back(fmt::format(
        "{}: joint angle deviations of Table 1 move the tool {:.1f} times as far as its link length "
        "deviations. {}",
        arm.name, ratio, arm.about));
  }
  study.notes.push_back("The paper draws these without figures; it says that joint angles matter more.");
  return study;
}

}  // namespace flexcomp::host
