// SPDX-License-Identifier: Apache-2.0
/// \file
/// The arms of the paper's studies with their assumed true errors (Chen et al. 2019, Table 1; docs/model.md, section 12).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "model/robot.hpp"
#include "model/term_set.hpp"

namespace flexcomp::host {

/// Pose of a measurement.
struct StudiedPose {
  std::array<double, joint_count> q_rad{};
  double payload_kg = 0;
};

/// A simulated arm with assumed errors.
struct StudiedArm {
  std::string name;  ///< TX60L
  Robot robot;
  TermSet truth;      ///< the 39 terms of Table 1
  std::string about;  ///< origin of the assumed errors
};

/// Table 1 as printed, stiffnesses read as N·mm/rad.
StudiedArm paper_tx60l();

/// RX160L, of which the paper prints no errors: Table 1 with stiffnesses × 20 and payload 6.23 kg, all else
/// scaled to the mean position error of 3.72 mm that the paper measured before calibration.
StudiedArm paper_rx160l();

/// Scales all errors of an arm but its compliances to a mean position error of the nominal arm.
StudiedArm scaled_to(const StudiedArm& arm, double mean_error_m, const std::vector<StudiedPose>& poses);

/// Distances between the positions of a true arm and the nominal one at the origin of Ftool, m.
std::vector<double> errors_before_m(const StudiedArm& arm, const TermSet& truth,
                                    const std::vector<StudiedPose>& poses);

/// Their mean with all errors of the arm.
double mean_error_before_m(const StudiedArm& arm, const std::vector<StudiedPose>& poses);

/// Random poses, uniform within the limits, payloads in turn (none given: the robot's).
std::vector<StudiedPose> random_poses(const StudiedArm& arm, std::size_t count, std::uint64_t seed,
                                      const std::vector<double>& payloads_kg = {});

enum class ErrorKind { joint_angles, link_lengths };
/// The Δθ alone, or the Δd alone, of Table 1, times `factor`.
TermSet part_of_table1(const StudiedArm& arm, ErrorKind kind, double factor);

}  // namespace flexcomp::host
