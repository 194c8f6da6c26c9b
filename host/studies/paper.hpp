// SPDX-License-Identifier: Apache-2.0
/// \file
/// The arms of the paper's studies with their assumed true errors (Chen et al. 2019, Table 1; docs/model.md, section 12).
#ifndef FLEXCOMP_HOST_STUDIES_PAPER_HPP
#define FLEXCOMP_HOST_STUDIES_PAPER_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "model/robot.hpp"
#include "model/term_set.hpp"

namespace flexcomp::host {

/// Where to measure.
struct StudiedPose {
  std::array<double, joint_count> q_rad{};
  double payload_kg = 0;
};

/// An arm whose errors are known because they are assumed.
struct StudiedArm {
  std::string name;  ///< TX60L
  Robot robot;
  TermSet truth;      ///< the 39 terms of Table 1
  std::string about;  ///< how the truth was made, where the paper prints none
};

/// Table 1 as printed, stiffnesses read as N·mm/rad.
StudiedArm paper_tx60l();

/// The paper prints no errors of this arm: Table 1 with stiffnesses × 20 and payload 6.23 kg, all else scaled until the
/// mean position error is the 3.72 mm that the paper measured before calibration.
StudiedArm paper_rx160l();

/// The same arm with everything but its compliances scaled until the mean position error of the nominal arm is this.
StudiedArm scaled_to(const StudiedArm& arm, double mean_error_m, const std::vector<StudiedPose>& poses);

/// Mean position error at the origin of Ftool of the nominal arm.
double mean_error_before_m(const StudiedArm& arm, const std::vector<StudiedPose>& poses);

/// Random poses within the limits, payloads in turn (none given: the robot's).
std::vector<StudiedPose> random_poses(const StudiedArm& arm, std::size_t count, std::uint64_t seed,
                                      const std::vector<double>& payloads_kg = {});

enum class ErrorKind { joint_angles, link_lengths };
/// Only the Δθ, or only the Δd, of Table 1, `factor` times their size.
TermSet part_of_table1(const StudiedArm& arm, ErrorKind kind, double factor);

}  // namespace flexcomp::host

#endif
