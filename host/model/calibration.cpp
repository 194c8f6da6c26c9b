// SPDX-License-Identifier: Apache-2.0
#include "model/calibration.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>
#include <ctime>

#include "quaternion.hpp"

namespace flexcomp::host {

Frame Frame::of(const Pose<double>& pose) { return {pose.position, unit_quaternion(pose.rotation)}; }

double CovarianceFactor::sigma(Eigen::Index parameter) const {
  const double shared = factor.row(parameter).norm();
  return own.size() == 0 ? shared : std::hypot(shared, own[parameter]);
}

Eigen::MatrixXd CovarianceFactor::columns() const {
  if (own.size() == 0) return factor;
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(factor.rows(), factor.cols() + own.size());
  out.leftCols(factor.cols()) = factor;
  out.rightCols(own.size()).diagonal() = own;
  return out;
}

std::string hex(const Sha256Digest& digest) {
  std::string text;
  for (const std::uint8_t byte : digest) text += fmt::format("{:02x}", byte);
  return text;
}

void stamp(Calibration& calibration, const Robot& robot) {
  calibration.robot = robot.name;
  calibration.nominal_hash = nominal_hash(robot.nominal);
  calibration.tool_version = FLEXCOMP_VERSION;
  calibration.date = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

}  // namespace flexcomp::host
