// SPDX-License-Identifier: Apache-2.0
/// \file
/// Targets in programs of robot makers: found, as joint commands, changed in place, and every other byte left as it was.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "exchange/text_edits.hpp"
#include "flexcomp/linear.hpp"
#include "model/robot.hpp"
#include "model/targets.hpp"

namespace flexcomp::host {

enum class ProgramLanguage {
  kuka,   ///< KRL: E6AXIS, AXIS, E6POS, POS in .src and .dat
  rapid,  ///< ABB: jointtarget and robtarget in .mod, .prg, .sys
  val3    ///< Stäubli: <Value j1=… j6=…/> in .dtx
};

/// One target as it stands in the program: joint readings, or a pose with what it says about the branch.
struct ProgramTarget {
  std::size_t line = 0;
  std::string name;  ///< empty where it has none
  bool pose = false;
  std::array<double, joint_count> q_rad{};
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  /// KUKA's T: bit j is set where joint j + 1 is negative; bits 6 … 11 are those of external axes.
  std::optional<unsigned> turn;
  std::optional<std::array<int, 3>> quadrant;  ///< ABB's cf1, cf4, cf6: quarter turns of joints 1, 4, 6

  std::optional<int> cfx;  ///< ABB's, where it is 0 … 7

  std::vector<TextSpan> numbers;        ///< joints, or position and orientation, where they stand in the text
  std::optional<TextSpan> turn_number;  ///< where `turn` stands
  std::vector<TextSpan> quadrant_numbers;
};

struct TargetProgram {
  std::string path;
  ProgramLanguage language = ProgramLanguage::kuka;
  std::string text;
  std::vector<ProgramTarget> targets;
  std::vector<std::string> warnings;  ///< what was seen and is left as it is, or not right for all targets
};

/// By the ending of the file's name; nothing for .csv and others. \throws InputError  a .dat that cannot be read
std::optional<ProgramLanguage> program_language(const std::string& path);

/// \throws InputError  file absent; a target that is incomplete or relative (file:line); no targets
TargetProgram read_program(const std::string& path, ProgramLanguage language);

/// The program with its targets put as in `corrected` (same order; q or pose, turn and quadrants): numbers with 6 decimals in
/// mm and degrees; words of the branch only where they change.
std::string program_text(const TargetProgram& program, const std::vector<ProgramTarget>& corrected);

/// A reading so near to an edge of its half or quarter turn [rad] counts to both sides: poses are written with 6 decimals.
constexpr double word_edge_rad = 1e-6;

/// The words of a target for these readings: as `before` where that is still right, with the bits of external axes.
unsigned turn_of(const std::array<double, joint_count>& q_rad, unsigned before);
std::array<int, 3> quadrants_of(const std::array<double, joint_count>& q_rad, std::array<int, 3> before);
/// Whether readings are those that the target's words ask for.
bool words_fit(const ProgramTarget& target, const std::array<double, joint_count>& q_rad);

/// The targets as joint commands, poses by the nominal inverse kinematics of the robot's tool. Of several solutions those that
/// the target's words (turn, quadrants, then cfx) name; of what remains the nearest to the command before, at first to `start`.
/// `frame` is F0 as seen from the frame of the program's poses.
/// \throws InputError  path:line: name: a pose that is not reached as its words say; several solutions without `start`
TargetsFile program_commands(const TargetProgram& program, const Robot& robot, const Pose<double>& frame,
                             const std::optional<std::array<double, joint_count>>& start,
                             const std::function<void(std::size_t done, std::size_t of)>& progress);

/// The program with these commands for its targets: a pose becomes the one to which they bring the nominal kinematics.
std::string with_commands(const TargetProgram& program, const Robot& robot, const Pose<double>& frame,
                          const std::vector<std::array<double, joint_count>>& q_rad);

}  // namespace flexcomp::host
