// SPDX-License-Identifier: Apache-2.0
/// \file
/// Observations: poses or positions with their covariance, from every kind of instrument.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "flexcomp/robot.hpp"
#include "measurement/measured_data.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Observation of one row in the measurement frame. Residuals, Eq. (M31), are e_p = p_m - p_model and e_R =
/// log(R R_modelᵀ), both in that frame.
struct Observation {
  std::array<double, joint_count> q_rad{};
  Context<double, joint_count> context;
  bool has_orientation = false;
  Eigen::Vector3d p_m = Eigen::Vector3d::Zero();
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  /// Whitening, Eq. (M22): whitening * [e_p; e_R] has unit covariance; for positions only the upper left 3x3
  /// block is not zero.
  Matrix6d whitening = Matrix6d::Zero();
  std::size_t line = 0;
  double misfit_chi2 = 0;      ///< of the reflector points to the template, (M26)
  std::size_t misfit_dof = 0;  ///< 0: no reflectors
};

/// Converts all rows of a data file to observations. Reflector points are fitted to the robot file's template,
/// Eq. (M24), or to one estimated over all rows, whose gauge (M23) is then part of E. Rows whose misfit (M26)
/// has a probability below 1e-6 are named in `warnings`, with the reflectors that may have moved
/// (suspect_reflectors()).
/// \throws InputError  nothing measured; reflectors on one line; a template without the D that the data have
std::vector<Observation> observe(const MeasuredData& data, const Robot& robot,
                                 std::vector<std::string>* warnings = nullptr);

}  // namespace flexcomp::host
