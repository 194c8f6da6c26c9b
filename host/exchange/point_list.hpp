// SPDX-License-Identifier: Apache-2.0
/// \file
/// Point lists as instruments' programs export them (SpatialAnalyzer, PolyWorks and their like): one point or frame a
/// line, with its name, in a unit that is declared.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "exchange/declared_unit.hpp"
#include "exchange/delimited_text.hpp"
#include "exchange/rotation_angles.hpp"
#include "exchange/time_stamp.hpp"
#include "units.hpp"

namespace flexcomp::host {

struct PointListOptions {
  DialectChoice dialect;
  /// Meaning of the columns in order, as name,group,x,y,z,-,sigma; empty: by the header.
  std::vector<std::string> columns;
  UnitSource length;  ///< where the file declares none; never against what it declares
  UnitSource angle;
  std::optional<AngleConvention> angles;
  double coverage = 1;  ///< the file's uncertainties are so many standard deviations
};

struct ListedPoint {
  std::size_t line = 0;
  std::string name;  ///< with :: between collection, group and point
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  double sigma_m = 0;  ///< per axis (root of the mean square where the file has three)
  TimeStamp time;
};

struct PointList {
  std::string path;
  Dialect dialect;
  Unit length;
  bool names = false;
  bool orientations = false;
  bool sigmas = false;
  bool times = false;
  std::vector<ListedPoint> points;
  std::vector<std::string> unused;  ///< columns that were not read: nominal values, deviations …
};

/// The names that PointListOptions::columns takes.
const std::vector<std::string>& point_column_names();

/// \throws InputError  as read_delimited(); a unit that is not declared, or otherwise than the option says; columns that
///                     are missing or there twice; angles without unit or convention; a cell that is no number; a
///                     quaternion whose norm is off 1 by more than 1e-3; an uncertainty that is not positive
PointList read_point_list(const std::string& path, const PointListOptions& options);

}  // namespace flexcomp::host
