// SPDX-License-Identifier: Apache-2.0
/// \file
/// Calibration: the identified terms with their covariance, the frames, and the robot they belong to.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "flexcomp/linear.hpp"
#include "flexcomp/robot.hpp"
#include "model/frames.hpp"
#include "model/robot.hpp"
#include "model/term_set.hpp"

namespace flexcomp::host {

struct Confounded {
  std::string parameter;          ///< was left out
  std::vector<std::string> with;  ///< which absorb it
};

/// A parameter whose estimate is the least that physics allows (a compliance of zero).
struct AtBound {
  std::string parameter;
  double upper_95 = 0;  ///< SI: end of the one-sided 95 % interval
};

/// Joint uncertainty of all that was fitted: covariance = factor * factor^T + diag(own^2), SI. The standard deviations
/// alone would not do: what two near-confounded parameters lack in common cancels in the pose that they predict.
struct CovarianceFactor {
  std::vector<std::string> parameters;  ///< frame_f.x_mm … frame_e.rz_deg, then parameters by name
  Eigen::MatrixXd factor;               ///< one row per parameter; lower triangular where `own` is empty
  Eigen::VectorXd own = {};    ///< standard deviation of what the factor leaves out; empty: nothing is
  Eigen::VectorXd scale = {};  ///< of which a row's numbers are whole multiples; 0: of none. Empty: all 0

  /// Standard deviation of one parameter, SI.
  double sigma(Eigen::Index parameter) const;
  /// A with covariance = A A^T: the factor with the diagonal of `own` as further columns.
  Eigen::MatrixXd columns() const;
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
  std::vector<unsigned> regularised;  ///< joints (from 1) whose curve carries what no name explains
  std::vector<Confounded> confounded;
  std::vector<AtBound> at_bound;
  std::vector<std::pair<std::string, double>> residuals;  ///< by name with unit, e.g. after_mean_mm
  std::string tool_version;
  std::string date;  ///< ISO 8601
  std::optional<std::uint32_t> sequence;

  bool is_regularised(unsigned joint) const {
    return std::find(regularised.begin(), regularised.end(), joint) != regularised.end();
  }
  Pose<double> f() const { return frames ? frames->f.pose() : Pose<double>(); }
  Pose<double> e() const { return frames ? frames->e.pose() : Pose<double>(); }
};

/// Sets robot, hash, tool version and date as of now, in a calibration that is about to be saved.
void stamp(Calibration& calibration, const Robot& robot);

/// 64 hexadecimal digits and back.
std::string hex(const Sha256Digest& digest);

}  // namespace flexcomp::host
