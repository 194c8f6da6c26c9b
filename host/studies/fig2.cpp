// SPDX-License-Identifier: Apache-2.0
// Fig. 2: 30 random poses, Table 1's joint angle deviations alone and link length deviations alone.
#include <fmt/format.h>

#include "flexcomp/forward.hpp"
#include "model/host_model.hpp"
#include "studies/calibrations.hpp"
#include "studies/study.hpp"

namespace flexcomp::host {

namespace {

/// Distance between true and nominal position at each pose, mm.
std::vector<double> errors_mm(const StudiedArm& arm, const TermSet& part,
                              const std::vector<StudiedPose>& poses) {
  const auto truth = prepare(part, arm.robot, arm.name);
  Workspace<double, joint_count> ws;
  std::vector<double> errors;
  for (const StudiedPose& pose : poses) {
    const auto context = default_context<double>(arm.robot.nominal);
    errors.push_back(1e3 * (forward(*truth, pose.q_rad, context, ws).position -
                            nominal_forward(*truth, pose.q_rad).position)
                               .norm());
  }
  return errors;
}

}  // namespace

Study study_fig2(const StudyOptions& options) {
  Study study;
  study.name = "fig2";
  study.title = "Fig. 2: which deviations matter";
  study.quantity = "mean position error over 30 random poses [mm]";
  study.label_names = {"arm", "deviations", "times Table 1"};
  for (const StudiedArm& arm : options.arms) {
    const std::vector<StudiedPose> poses = random_poses(arm, 30, options.seed);
    Curves curves;
    curves.described = "Position errors at 30 poses by kind and size of the deviations of " + arm.name;
    curves.x_name = "pose";
    curves.y_name = "mm";
    curves.log_y = true;
    double ratio = 0;
    for (const double factor : {1.0, 10.0, 100.0}) {
      double means[2] = {0, 0};
      for (const ErrorKind kind : {ErrorKind::joint_angles, ErrorKind::link_lengths}) {
        const std::vector<double> errors = errors_mm(arm, part_of_table1(arm, kind, factor), poses);
        const bool angles = kind == ErrorKind::joint_angles;
        Curve curve{fmt::format("{} × {:g}", angles ? "Δθ" : "Δd", factor), {}};
        double& mean = means[angles ? 0 : 1];
        for (std::size_t k = 0; k < errors.size(); ++k) {
          mean += errors[k] / static_cast<double>(errors.size());
          curve.points.push_back({static_cast<double>(k + 1), errors[k]});
        }
        curves.curves.push_back(curve);
        StudyRow row;
        row.labels = {arm.name, angles ? "joint angles" : "link lengths d", fmt::format("{:g}", factor)};
        row.ours = mean;
        study.rows.push_back(row);
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
