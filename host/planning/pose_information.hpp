// SPDX-License-Identifier: Apache-2.0
/// \file
/// Rows of the whitened, scaled identification matrix H (Chen et al. 2019, Eq. 23) that one measured pose contributes;
/// about 2 microseconds a pose.
#ifndef FLEXCOMP_HOST_PLANNING_POSE_INFORMATION_HPP
#define FLEXCOMP_HOST_PLANNING_POSE_INFORMATION_HPP

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

/// Most unknowns that a plan is made for: 39 of the model, less 6 of the base, and 12 of the frames, is 45.
constexpr int most_unknowns = 48;

/// Rows of H of one pose, transposed: a row per unknown (frames first), a column per measured number (6, or 3 where only
/// positions are measured). Whitened, and scaled by the fixed units of unit_of().
using Block = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, most_unknowns, 6>;

/// How a pose is measured, and how well.
class Instrument {
 public:
  /// Standard deviations per axis (m, rad).
  static Instrument pose(double position_sigma_m, double orientation_sigma_rad);
  static Instrument position(double sigma_m);
  /// Each coordinate of each reflector with sigma_m; points of the template in Ftool.
  static Instrument reflectors(const std::vector<Eigen::Vector3d>& template_m, double sigma_m);

  Eigen::Index rows() const { return rows_; }

 private:
  friend class PoseInformation;
  Eigen::Index rows_ = 6;
  bool isotropic_ = true;  ///< position and orientation each alike in all directions
  /// Of [position; rotation vector] in Ftool: its square is the information.
  Eigen::Matrix<double, 6, 6> whitening_ = Eigen::Matrix<double, 6, 6>::Identity();
};

/// A pose with its measurement, made or planned.
struct PlannedMeasurement {
  Joints q_rad{};
  PoseContext context;
  Instrument instrument = Instrument::position(1);
};

/// The unknowns of a plan, and H at any pose. Immutable after construction, thread-safe.
class PoseInformation {
 public:
  /// \param frames    the measurement's frames F and E will be fitted: they take the base's place and count as
  ///                  nuisance, of any position near the nominal one
  /// \param like      contexts and instruments that there will be; 1,000 random poses measured like these, in turn, show
  ///                  which parameters such data identify (the others are left out, as in identify)
  PoseInformation(const Robot& robot, ModelKind kind, bool frames,
                  const std::vector<PlannedMeasurement>& like, std::uint64_t seed = 1);

  Eigen::Index unknowns() const { return nuisance() + parameters(); }
  Eigen::Index nuisance() const { return static_cast<Eigen::Index>(frames_.size()); }  ///< of F and E
  Eigen::Index parameters() const {
    return static_cast<Eigen::Index>(columns_.size());
  }  ///< identifiable ones
  std::size_t parameters_of_model() const { return parameters_of_model_; }

  /// Names of the identifiable parameters, and what one scaled unit of each is in the unit of files.
  const std::vector<std::string>& names() const { return names_; }
  const std::vector<double>& file_units() const { return file_units_; }

  /// H of one pose. About 2 microseconds.
  void block(const PlannedMeasurement& sight, Block& out) const {
    block(sight.q_rad, sight.context, sight.instrument, out);
  }
  void block(const Joints& q_rad, const PoseContext& context, const Instrument& instrument, Block& out) const;

 private:
  struct Column {
    Term<double> term;
    double unit = 1;
  };
  using SmallModel = Model<double, joint_count, Capacity<1, 1, 1>>;

  SmallModel model_;                 ///< the nominal arm: every coefficient is zero there
  std::vector<std::size_t> frames_;  ///< 0 … 5 are x y z rx ry rz of F, 6 … 11 those of E
  std::vector<double> frame_units_;
  std::vector<Column> columns_;
  std::vector<std::string> names_;
  std::vector<double> file_units_;
  std::size_t parameters_of_model_ = 0;
};

}  // namespace flexcomp::host

#endif
