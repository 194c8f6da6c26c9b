// SPDX-License-Identifier: Apache-2.0
/// \file
/// Feasibility of a measurement pose: joint limits, collisions, and the laser tracker's beam (Chen et al. 2019, Section
/// 3.2, Eq. 26-29), by exact distances.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "flexcomp/forward.hpp"
#include "flexcomp/model.hpp"
#include "model/cell.hpp"
#include "model/robot.hpp"
#include "planning/segments.hpp"

namespace flexcomp::host {

/// Why a pose is not feasible.
enum class Obstruction {
  none,
  joint_limit,    ///< a reading beyond its limit, or no number
  bodies_touch,   ///< two bodies of the arm, or one of them and an obstacle
  tool_too_near,  ///< a reflector or an arm of the tool at a body
  beam_blocked,   ///< a body too near to the line from the tracker to a reflector
  facing_away     ///< the beam comes in at a larger angle than a reflector accepts
};

/// Text of an obstruction for messages: "beam blocked".
std::string name_of(Obstruction obstruction);

/// Tests single poses of the nominal arm for feasibility, Eq. (M48) and (M49), radii r_i of bodies, r_s of a reflector:
///
/// - *Beam and angle*, where the cell has a tracker: every reflector must be visible. The beam's angle to -N (N
///   is +Z of Ftool) is at most the acceptance, and the segment from the tracker to the reflector keeps more
///   than r_i + s * r_s from every body's axis. Arms of the tool do not block beams.
/// - *Tool*: reflectors, and arms from the origin of Ftool to each of them, keep more than r_i + s * r_s from
///   every body. A tool without reflectors is tested with its tool point as the reflector. Bodies on frame 6 (a
///   gripper, say) move with the tool and are not tested against it.
/// - *Mounted near*: where no pose lets a reflector (or an arm) keep s from a body of the arm, because the tool
///   is mounted beside it, that pair - and this reflector's beam at that body - has to keep 1 instead of s, the
///   reflector itself; if no pose allows that either, 0: not inside the body; else it is not tested. A warning
///   says so. (The reference tool on the TX60L: reflector A is 138 mm from the wrist's centre at every pose,
///   and 95 + 3 * 19.05 mm would be 152.) Obstacles and bodies on frame 0 get no such allowance.
/// - *Arm*: bodies keep more than r_i + r_j from each other and from obstacles. Left out are bodies of the same frame;
///   neighbours (no frame between theirs has a body), which overlap at their joint; pairs that touch at every pose, as
///   fat bodies around a joint do; bodies on frame 0 against obstacles, and any other pair whose distance no joint changes.
///
/// "At any pose" is judged on some thousand random poses in the joint limits, the same in every run.
/// Const and thread-safe; about a microsecond a call.
class Feasibility {
 public:
  explicit Feasibility(const Robot& robot, const std::optional<Cell>& cell = {});

  /// The first obstruction found, cheap tests first: joint limit, facing, bodies, tool, beam.
  Obstruction check(const std::array<double, joint_count>& q_rad) const;
  bool allows(const std::array<double, joint_count>& q_rad) const {
    return check(q_rad) == Obstruction::none;
  }
  /// Describes the obstruction in one sentence with names and figures; empty where the pose is feasible.
  std::string why(const std::array<double, joint_count>& q_rad) const;
  /// Tests that are left out or relaxed, in complete sentences.
  const std::vector<std::string>& warnings() const { return warnings_; }
  /// The cell file, or the robot file where there is no cell.
  const std::string& source() const { return source_; }

 private:
  struct Body {
    Capsule capsule;
    std::string name;
    bool obstacle = false;
    double half_length_m = 0;
    double largest_clearance_m = 0;  ///< upper bound of the clearances below
    /// Clearances from the axis per reflector, m, of the reflector, its beam and its arm; below 0: not tested.
    std::vector<double> reflector_clearance_m = {};
    std::vector<double> beam_clearance_m = {};
    std::vector<double> arm_clearance_m = {};
  };
  struct Pair {
    std::size_t first;
    std::size_t second;
  };
  struct Finding {
    Obstruction obstruction = Obstruction::none;
    std::size_t first = 0;   ///< joint, reflector, or body
    std::size_t second = 0;  ///< body
    double actual = 0;       ///< m or rad
    double allowed = 0;      ///< m or rad
    bool arm = false;        ///< the tool's arm to the reflector
  };
  using Joints = std::array<double, joint_count>;
  using LinkFrames = Frames<double, joint_count>;

  using Axes = std::vector<Segment>;  ///< of all bodies, in F0

  void place(const Joints& q_rad, LinkFrames& frames) const;
  Segment placed(const Body& body, const LinkFrames& frames) const;
  Eigen::Vector3d placed(const Eigen::Vector3d& in_flange_m, const LinkFrames& frames) const;
  Finding find(const Joints& q_rad) const;
  bool find_facing(const LinkFrames& frames, Finding& finding) const;
  bool find_collision(const Axes& axes, Finding& finding) const;
  bool find_tool(const LinkFrames& frames, const Axes& axes, Finding& finding) const;
  bool find_beam(const LinkFrames& frames, const Axes& axes, Finding& finding) const;
  void choose_pairs(const Robot& robot, const std::vector<LinkFrames>& samples);
  void choose_clearances(const std::vector<LinkFrames>& samples);
  void warn_of_tracker();
  std::string reflector_name(std::size_t k) const;

  std::string source_;
  std::array<LinkShape<double>, joint_count> links_;
  std::array<JointLimits, joint_count> limits_;
  std::vector<Body> bodies_;                ///< of the robot, then obstacles
  std::vector<Pair> pairs_;                 ///< bodies that must not touch
  std::vector<Eigen::Vector3d> reflector_;  ///< in F6
  Eigen::Vector3d centre_;                  ///< of the tool, in F6
  Eigen::Vector3d normal_;                  ///< N in F6
  double tool_radius_m_ = 0;                ///< from the centre to the farthest reflector
  bool tool_point_only_ = false;            ///< the only reflector is the tool point
  std::optional<Eigen::Vector3d> tracker_m_;
  double cos_acceptance_ = 0;
  double safety_ = 3;
  double smr_radius_m_ = 0;
  std::vector<std::string> warnings_;
};

/// Samples `count` feasible poses, uniform within the joint limits, rad.
/// \throws InputError  naming the cell (or robot) file and the frequency of each obstruction, where fewer than
///                     about one random pose in a thousand is feasible
std::vector<std::array<double, joint_count>> feasible_poses(const Feasibility& feasibility,
                                                            const Robot& robot, std::size_t count,
                                                            std::uint64_t seed);

}  // namespace flexcomp::host
