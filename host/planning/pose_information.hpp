// SPDX-License-Identifier: Apache-2.0
/// \file
/// Rows of the whitened, scaled identification matrix H (Chen et al. 2019, Eq. 23) that one measured pose contributes;
/// about 2 microseconds a pose.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "flexcomp/model.hpp"
#include "measurement/measured_data.hpp"
#include "model/paper_model.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

using Joints = std::array<double, joint_count>;
using PoseContext = Context<double, joint_count>;

/// Limit of the unknowns of a plan: 39 of the model, less 6 of the base, plus 12 of the frames, is 45.
constexpr int most_unknowns = 48;

/// Rows of H of one pose, transposed: a row per unknown (frames first), a column per measured number (6, or 3 where only
/// positions are measured). Whitened, and scaled by the fixed units of unit_of().
using Block = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, most_unknowns, 6>;

/// Kind and standard deviation of a measurement.
class Instrument {
 public:
  /// Standard deviations per axis (m, rad).
  static Instrument pose(double position_sigma_m, double orientation_sigma_rad);
  static Instrument position(double sigma_m);
  /// Standard deviation sigma_m of each coordinate of each reflector; template points in Ftool, m. Information (M25).
  static Instrument reflectors(const std::vector<Eigen::Vector3d>& template_m, double sigma_m);

  Eigen::Index rows() const { return rows_; }

 private:
  friend class PoseInformation;
  Eigen::Index rows_ = 6;
  bool isotropic_ = true;  ///< position and orientation each isotropic
  /// Whitening of [position; rotation vector] in Ftool, Eq. (M22).
  Eigen::Matrix<double, 6, 6> whitening_ = Eigen::Matrix<double, 6, 6>::Identity();
};

/// A pose with its context and instrument, measured or planned.
struct PlannedMeasurement {
  Joints q_rad{};
  PoseContext context;
  Instrument instrument = Instrument::position(1);
};

/// Unknowns of a plan, and their rows of H at any pose. Immutable after construction, thread-safe.
class PoseInformation {
 public:
  /// \param frames    the measurement frames F and E will be fitted: they replace the base and are nuisance parameters,
  ///                  near their nominal values
  /// \param like      contexts and instruments of the measurements; 1,000 random poses measured like these, in
  ///                  turn, show which parameters are identifiable (M33); the others are left out, as in
  ///                  identify
  PoseInformation(const Robot& robot, ModelKind kind, bool frames,
                  const std::vector<PlannedMeasurement>& like, std::uint64_t seed = 1);

  Eigen::Index unknowns() const { return nuisance() + parameters(); }
  Eigen::Index nuisance() const { return static_cast<Eigen::Index>(frames_.size()); }  ///< of F and E
  /// Number of identifiable parameters.
  Eigen::Index parameters() const { return static_cast<Eigen::Index>(columns_.size()); }
  std::size_t parameters_of_model() const { return parameters_of_model_; }

  /// Names of the identifiable parameters, and the size of one scaled unit of each in the unit of files.
  const std::vector<std::string>& names() const { return names_; }
  const std::vector<double>& file_units() const { return file_units_; }

  /// Computes the rows of H of one pose, about 2 microseconds.
  void block(const PlannedMeasurement& measurement, Block& out) const {
    block(measurement.q_rad, measurement.context, measurement.instrument, out);
  }
  void block(const Joints& q_rad, const PoseContext& context, const Instrument& instrument, Block& out) const;

 private:
  struct Column {
    Term<double> term;
    double unit = 1;
  };
  using SmallModel = Model<double, joint_count, Capacity<1, 1, 1>>;

  SmallModel model_;                 ///< the nominal arm
  std::vector<std::size_t> frames_;  ///< 0 … 5 are x y z rx ry rz of F, 6 … 11 those of E
  std::vector<double> frame_units_;
  std::vector<Column> columns_;
  std::vector<std::string> names_;
  std::vector<double> file_units_;
  std::size_t parameters_of_model_ = 0;
};

}  // namespace flexcomp::host
