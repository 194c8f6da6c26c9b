/// \file
/// The robot file: nominal geometry, limits, tool, payload, noise of the instrument and bodies of one arm.
#ifndef FLEXCOMP_HOST_FILES_ROBOT_FILE_HPP
#define FLEXCOMP_HOST_FILES_ROBOT_FILE_HPP

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "files/capsule.hpp"
#include "flexcomp/robot.hpp"

namespace flexcomp::host {

constexpr std::size_t joint_count = 6;

struct RobotFile {
  std::string path;  ///< as it was given, for messages
  std::string name;
  NominalRobot<joint_count> nominal;          ///< with name_hash of `name`
  std::vector<Eigen::Vector3d> reflectors_m;  ///< A, B, C(, D) in Ftool; empty where the file has none
  bool has_noise = false;              ///< false: the two figures below are this program's, not the file's
  double position_sigma_m = 0.035e-3;  ///< standard deviation per axis of a measured point
  double orientation_sigma_rad = 0.007 * 3.14159265358979323846 / 180;  ///< per axis of the rotation vector
  std::array<double, joint_count> max_speed_rad_s{};                    ///< 0 where unknown
  std::array<double, joint_count> gear_ratio{};  ///< motor turns per joint turn, 0 where unknown
  std::vector<Capsule> capsules;
};

/// Links longer than any arm's: d that ran off. Where two axes are nearly parallel, a maker's table of calibrated
/// Denavit-Hartenberg parameters holds hundreds of metres of d on one link and as much against it on the next; nothing can
/// be identified from there.
constexpr double longest_link_m = 20;
enum class LongLinks { refused, taken };

/// Reads and checks a robot file.
/// \throws InputError  file absent or no YAML; a key that is unknown (with the nearest known one), missing, given twice
///                     or of the wrong kind; not six joints; a number that is not finite; min >= max; a quaternion
///                     whose norm is off 1 by more than 1e-3; |d| or |a| above longest_link_m
RobotFile load_robot(const std::string& path, LongLinks long_links = LongLinks::refused);

/// The same from the text of a robot file; `name` stands for its path in messages.
RobotFile parse_robot(const std::string& text, const std::string& name);

/// A robot file from which load_robot() gives the identical robot back; what is unknown or absent is left out. `comment`
/// goes before it, as lines without their #.
std::string robot_text(const RobotFile& robot, const std::vector<std::string>& comment);

}  // namespace flexcomp::host

#endif
