// SPDX-License-Identifier: Apache-2.0
/// \file
/// Whitened residuals of measured poses against the model, with their exact derivatives.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "flexcomp/linear.hpp"
#include "identification/prior_knowledge.hpp"
#include "measurement/observation.hpp"
#include "model/host_model.hpp"
#include "model/term_set.hpp"

namespace flexcomp::host {

/// Estimate: the coefficients of all terms and the measurement frames.
struct Estimate {
  TermSet set = {};
  Pose<double> f = {};  ///< Fb in the measurement frame
  Pose<double> e = {};  ///< measured frame in Ftool
};

/// Unknowns of a fit: free frame parameters first in every matrix, then the parameters.
struct Unknowns {
  /// Free frame parameters: 0 … 5 are x y z rx ry rz of F, 6 … 11 those of E. Ascending; empty: frames are fixed.
  std::vector<std::size_t> frames = {};
  std::vector<Parameter> parameters = {};
  std::vector<PriorKnowledge> prior = {};  ///< one per parameter; may be shorter: the others have none
  std::vector<GroupPrior> groups = {};     ///< of parameters that have no tolerance in `prior`

  std::size_t count() const { return frames.size() + parameters.size(); }
  PriorKnowledge prior_of(std::size_t parameter) const {
    return parameter < prior.size() ? prior[parameter] : PriorKnowledge();
  }
};

/// Frame parameters of F and E that these rows can identify: 12, or 9 where no orientation was measured.
std::vector<std::size_t> free_frames(const std::vector<Observation>& rows);

/// Residual of one row, Eq. (M31): e_p = p - p_model (m), e_R = log(R R_modelᵀ) (rad, zero where not measured), both in
/// the measurement frame.
struct RowResidual {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d orientation_rad = Eigen::Vector3d::Zero();
};

/// Whitened residual W [e_p; e_R], of unit covariance, Eq. (M22).
Vector6<double> whitened(const Observation& row, const RowResidual& residual);
/// Inverse of whitened(): m and rad.
Vector6<double> unwhitened(const Observation& row, const Vector6<double>& whitened);

/// Residuals of all rows, in their order, Eq. (M31).
std::vector<RowResidual> residuals(const Estimate& estimate, const HostModel& model,
                                   const std::vector<Observation>& rows);
/// The same of a model that is prepared for them. \param source  names the terms in messages
std::vector<RowResidual> residuals(const Estimate& estimate, const Robot& robot,
                                   const std::vector<Observation>& rows, const std::string& source);
/// All rows stacked, six numbers each, whitened.
Eigen::VectorXd whitened(const std::vector<RowResidual>& residuals, const std::vector<Observation>& rows);

/// Whitened residuals and minus their derivative, Eq. (M32): residual(x + dx) = residual - derivative * dx to
/// first order, each row block six high (three of them zero for positions). Columns are scaled by unit_of(): dx
/// counts in these units.
struct Linearised {
  Eigen::VectorXd residual;
  Eigen::MatrixXd derivative;
};

Linearised linearised(const Estimate& estimate, const HostModel& model, const std::vector<Observation>& rows,
                      const Unknowns& unknowns);

/// Fixed unit of a parameter, SI: 0.05 degrees, 0.1 mm, 1e-5 rad/(N·m), 1e-3 rad for link gravity, else the usual size
/// of the effect (docs/model.md, section 7).
double unit_of(const Parameter& parameter, const TermSet& set);

/// Units of all unknowns, frames first.
Eigen::VectorXd units_of(const Unknowns& unknowns, const TermSet& set);

/// Adds dx, in units_of(), to an estimate; F and E on the manifold.
void move(Estimate& estimate, const Unknowns& unknowns, const Eigen::VectorXd& dx);

/// Names of all unknowns, frames first: frame_f.x_mm … frame_e.rz_deg, then the parameters.
std::vector<std::string> names_of(const Unknowns& unknowns);

/// [v]x: skew(v) * w is the cross product v x w.
Eigen::Matrix3d skew(const Eigen::Vector3d& v);
/// Rotation vector log(R), rad; angle at most pi.
Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& rotation);
/// Rotation matrix exp(w). \param rotation_vector_rad  w, of any length
Eigen::Matrix3d rotation_of(const Eigen::Vector3d& rotation_vector_rad);

}  // namespace flexcomp::host
