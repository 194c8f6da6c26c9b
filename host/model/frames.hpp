// SPDX-License-Identifier: Apache-2.0
/// \file
/// Frames of the measurement: F (robot base in the instrument) and E (measured point in the tool), Eq. (M1) of docs/model.md.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "flexcomp/linear.hpp"

namespace flexcomp::host {

inline Pose<double> inverse(const Pose<double>& pose) {
  return {pose.rotation.transpose(), -(pose.rotation.transpose() * pose.position)};
}

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

}  // namespace flexcomp::host
