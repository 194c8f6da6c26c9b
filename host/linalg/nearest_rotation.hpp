// SPDX-License-Identifier: Apache-2.0
#ifndef FLEXCOMP_HOST_LINALG_NEAREST_ROTATION_HPP
#define FLEXCOMP_HOST_LINALG_NEAREST_ROTATION_HPP

#include <Eigen/Core>

namespace flexcomp::host {

/// The rotation R that maximises tr(R^T A) (Kabsch). Where A has rank 2, as for points in a plane, the determinant says
/// which way the third direction points.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& a);

}  // namespace flexcomp::host

#endif
