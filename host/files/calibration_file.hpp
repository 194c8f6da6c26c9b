/// \file
/// Truth and calibration files: the terms by name with their uncertainty, the frames of the measurement, and which
/// robot they belong to.
#ifndef FLEXCOMP_HOST_FILES_CALIBRATION_FILE_HPP
#define FLEXCOMP_HOST_FILES_CALIBRATION_FILE_HPP

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "catalogue/term_set.hpp"
#include "files/robot_file.hpp"
#include "flexcomp/linear.hpp"
#include "flexcomp/robot.hpp"

namespace flexcomp::host {

/// A rigid transform as it stands in a file.
struct Frame {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< norm 1, w >= 0

  Pose<double> pose() const { return {orientation.toRotationMatrix(), position_m}; }
  static Frame of(const Pose<double>& pose);
};

/// T_measured = F B A1 … A6 Tool E.
struct MeasurementFrames {
  Frame f;  ///< Fb in the measurement frame
  Frame e;  ///< the measured point or frame in Ftool
};

struct Confounded {
  std::string parameter;          ///< was left out
  std::vector<std::string> with;  ///< and is carried by these
};

/// A parameter whose estimate is the least that physics allows (a compliance of zero).
struct AtBound {
  std::string parameter;
  double upper_95 = 0;  ///< SI: end of the one-sided 95 % interval
};

/// Joint uncertainty of all that was fitted (frames first): covariance = factor * factor^T, SI. The standard deviations
/// alone would not do: what two near-confounded parameters lack in common cancels in the pose that they predict.
struct CovarianceFactor {
  std::vector<std::string> parameters;  ///< frame_f.x_mm … frame_e.rz_deg, then parameters by name
  Eigen::MatrixXd factor;               ///< lower triangular, one row per parameter
};

struct Calibration {
  std::string path;   ///< as given, for messages
  std::string robot;  ///< name; empty in a truth file that leaves it out
  std::optional<Sha256Digest> nominal_hash;
  TermSet terms;
  std::vector<double>
      sigma;  ///< standard deviation per term in SI, NaN where none; may be shorter than terms
  std::vector<double> value_sigma;          ///< the same per value of the tables
  std::optional<MeasurementFrames> frames;  ///< where fitted; the base is then not pushed
  std::optional<CovarianceFactor> covariance;
  std::vector<Confounded> confounded;
  std::vector<AtBound> at_bound;
  std::vector<std::pair<std::string, double>> residuals;  ///< by name with unit, e.g. after_mean_mm
  std::string tool_version;
  std::string date;  ///< ISO 8601
  std::optional<std::uint32_t> sequence;

  Pose<double> f() const { return frames ? frames->f.pose() : Pose<double>(); }
  Pose<double> e() const { return frames ? frames->e.pose() : Pose<double>(); }
};

/// Reads a truth or calibration file. Terms come in the order of the file; one that is not named there does not exist.
/// \throws InputError  file:line: field for: no YAML, a key that is unknown or given twice, an effect that is not in the
///                     catalogue or named twice, a value out of range, base or tool above 20 mm or 2 degrees, another
///                     robot's name or nominal hash
Calibration load_calibration(const std::string& path, const RobotFile& robot);

/// The text of a calibration file; load_calibration() gives back the identical terms, bit by bit and in order, where
/// geometry, base, tool and effects stand in that order in the set (as load_calibration() and paper_model() make it).
/// \throws std::invalid_argument  a term that the catalogue cannot name
std::string calibration_text(const Calibration& calibration, const RobotFile& robot);

/// Writes calibration_text() atomically. \throws std::runtime_error where the file cannot be written
void save_calibration(const std::string& path, const Calibration& calibration, const RobotFile& robot);

/// Sets robot, hash, tool version and date as of now, in a calibration that is about to be saved.
void stamp(Calibration& calibration, const RobotFile& robot);

/// 64 hexadecimal digits and back.
std::string hex(const Sha256Digest& digest);

}  // namespace flexcomp::host

#endif
