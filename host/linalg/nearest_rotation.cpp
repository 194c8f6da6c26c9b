// SPDX-License-Identifier: Apache-2.0
#include "linalg/nearest_rotation.hpp"

#include <Eigen/LU>
#include <Eigen/SVD>

namespace flexcomp::host {

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& a) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d sign(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

}  // namespace flexcomp::host
