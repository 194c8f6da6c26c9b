// SPDX-License-Identifier: Apache-2.0
#include "identification/residuals.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "flexcomp/forward.hpp"
#include "flexcomp/identification.hpp"
#include "linalg/decompositions.hpp"
#include "model/effects/descriptor.hpp"
#include "model/place.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

constexpr double frame_length_m = 1e-4;
const double frame_angle_rad = radians(0.05);

/// d log(A exp(-w)) = -J w at w = 0 with e = log A: the inverse right Jacobian of SO(3) (Sola et al. 2018, Eq. 144).
Eigen::Matrix3d inverse_right_jacobian(const Eigen::Vector3d& e) {
  const double angle = e.norm();
  const Eigen::Matrix3d s = skew(e);
  const double half = 0.5 * angle;
  const double square =
      angle < 1e-4 ? 1.0 / 12 : (1 - half * std::cos(half) / std::sin(half)) / (angle * angle);
  return Eigen::Matrix3d::Identity() + 0.5 * s + square * s * s;
}

RowResidual residual_of(const Estimate& estimate, const Observation& row, const Pose<double>& pose,
                        const Eigen::Vector3d& point) {
  RowResidual r;
  r.position_m = row.p_m - (estimate.f.rotation * point + estimate.f.position);
  if (row.has_orientation) {
    const Eigen::Matrix3d model = estimate.f.rotation * pose.rotation * estimate.e.rotation;
    r.orientation_rad = rotation_vector(row.R * model.transpose());
  }
  return r;
}

/// Derivative of a table term for one value of its table: spline weight (M6) or bilinear weight (M7), times the factor.
double table_weight(const TermSet& set, const Term<double>& term, std::size_t value, const HostModel& model,
                    const Linearisation<double, joint_count>& at, const Observation& row) {
  const Table& table = set.tables[term.table];
  const std::size_t index = value - table.offset;
  if (term.basis == Basis::curve) {
    const auto weights = detail::curve_weights(row.q_rad[term.joint], table.size);
    double weight = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      if (weights.index[i] == index) weight += weights.w[i];
    }
    if (weight == 0) return 0;
    switch (term.factor) {
      case Factor::load_torque:
        return weight * detail::moment_about<double>(at.unloaded.load, at.unloaded.frames.axis(term.joint, 2),
                                                     at.unloaded.frames.origin[term.joint]);
      case Factor::temperature:
        return weight * (row.context.temperature_c - model.reference_temperature());
      case Factor::payload:
        return weight * row.context.payload_kg;
      default:
        return weight;
    }
  }
  const double* nodes = set.values.data() + table.offset;
  const auto along_rows = detail::find_cell<double>(
      nodes, table.rows,
      detail::covariate<double, joint_count>(table.row_covariate, table.row_joint, row.q_rad, row.context));
  const auto along_columns =
      detail::find_cell<double>(nodes + table.rows, table.columns,
                                detail::covariate<double, joint_count>(
                                    table.column_covariate, table.column_joint, row.q_rad, row.context));
  const std::size_t cell = index - table.rows - table.columns;
  const auto share = [](std::size_t node, const detail::Cell<double>& c) {
    return node == c.index ? 1 - c.fraction : (node == c.index + 1 ? c.fraction : 0.0);
  };
  return share(cell / table.columns, along_rows) * share(cell % table.columns, along_columns);
}

/// Derivative of the pose (origin of Ftool, in Fb) for a parameter, Eq. (M20).
Vector6<double> pose_column(const Parameter& parameter, const TermSet& set, const HostModel& model,
                            const Linearisation<double, joint_count>& at,
                            const LoadResponse<double, joint_count>& response, const Observation& row) {
  Vector6<double> column = Vector6<double>::Zero();
  for (const std::size_t t : parameter.terms) {
    const Term<double>& term = set.terms[t];
    if (!parameter.value) {
      column += exact_column(model, at, response, term, row.context);
      continue;
    }
    const double weight = table_weight(set, term, *parameter.value, model, at, row);
    if (weight != 0) column += screw(model, at, term.place) * (term.coefficient * weight);
  }
  return column;
}

/// Columns of F and E: rows position and rotation vector of the measured point, in the measurement frame.
Eigen::Matrix<double, 6, 12> frame_columns_of(const Estimate& estimate, const Pose<double>& pose,
                                              const Eigen::Vector3d& point) {
  const Eigen::Matrix3d& f = estimate.f.rotation;
  Eigen::Matrix<double, 6, 12> all = Eigen::Matrix<double, 6, 12>::Zero();
  all.block<3, 3>(0, 0).setIdentity();
  all.block<3, 3>(0, 3) = -skew(f * point);
  all.block<3, 3>(3, 3).setIdentity();
  all.block<3, 3>(0, 6) = f * pose.rotation;
  all.block<3, 3>(3, 9) = f * pose.rotation * estimate.e.rotation;
  return all;
}

}  // namespace

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn{Eigen::Quaterniond(rotation).normalized()};
  return turn.axis() * (turn.angle() > pi ? turn.angle() - 2 * pi : turn.angle());
}

Eigen::Matrix3d rotation_of(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  if (angle < 1e-300) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, w / angle).toRotationMatrix();
}

Vector6<double> whitened(const Observation& row, const RowResidual& residual) {
  Vector6<double> e;
  e << residual.position_m, residual.orientation_rad;
  return row.whitening * e;
}

Vector6<double> unwhitened(const Observation& row, const Vector6<double>& whitened) {
  const Eigen::Index n = row.has_orientation ? 6 : 3;
  Vector6<double> e = Vector6<double>::Zero();
  e.head(n) = inverse(row.whitening.topLeftCorner(n, n)) * whitened.head(n);
  return e;
}

std::vector<RowResidual> residuals(const Estimate& estimate, const HostModel& model,
                                   const std::vector<Observation>& rows) {
  std::vector<RowResidual> out;
  out.reserve(rows.size());
  Workspace<double, joint_count> ws;
  for (const Observation& row : rows) {
    const Pose<double> pose = forward(model, row.q_rad, row.context, ws);
    const Eigen::Vector3d point = pose.position + pose.rotation * (ws.point + estimate.e.position);
    out.push_back(residual_of(estimate, row, pose, point));
  }
  return out;
}

std::vector<RowResidual> residuals(const Estimate& estimate, const Robot& robot,
                                   const std::vector<Observation>& rows, const std::string& source) {
  return residuals(estimate, *prepare(estimate.set, robot, source), rows);
}

Eigen::VectorXd whitened(const std::vector<RowResidual>& residuals, const std::vector<Observation>& rows) {
  Eigen::VectorXd out(6 * static_cast<Eigen::Index>(residuals.size()));
  for (std::size_t k = 0; k < residuals.size(); ++k)
    out.segment<6>(6 * static_cast<Eigen::Index>(k)) = whitened(rows[k], residuals[k]);
  return out;
}

Linearised linearised(const Estimate& estimate, const HostModel& model, const std::vector<Observation>& rows,
                      const Unknowns& unknowns) {
  const Eigen::Index n = static_cast<Eigen::Index>(rows.size());
  const Eigen::Index columns = static_cast<Eigen::Index>(unknowns.count());
  Linearised out;
  out.residual.resize(6 * n);
  out.derivative.resize(6 * n, columns);
  const Eigen::VectorXd units = units_of(unknowns, estimate.set);
  Linearisation<double, joint_count> at;
  LoadResponse<double, joint_count> response;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Observation& row = rows[static_cast<std::size_t>(k)];
    linearise(model, row.q_rad, row.context, at);
    load_response(model, at, row.context, response);
    const Eigen::Vector3d lever = at.pose.rotation * (at.loaded.point + estimate.e.position);
    const Eigen::Vector3d point = at.pose.position + lever;
    const RowResidual r = residual_of(estimate, row, at.pose, point);
    out.residual.segment<6>(6 * k) = whitened(row, r);

    // From a motion of the measured point in the measurement frame to the whitened residual ...
    Matrix6d from_point = row.whitening;
    if (row.has_orientation) {
      from_point.rightCols<3>() = row.whitening.rightCols<3>() * inverse_right_jacobian(r.orientation_rad);
    } else {
      from_point.rightCols<3>().setZero();
    }
    Eigen::Index c = 0;
    if (!unknowns.frames.empty()) {
      const Eigen::Matrix<double, 6, 12> all = frame_columns_of(estimate, at.pose, point);
      for (const std::size_t i : unknowns.frames) {
        out.derivative.block<6, 1>(6 * k, c).noalias() =
            from_point * (all.col(static_cast<Eigen::Index>(i)) * units[c]);
        ++c;
      }
    }
    // ... and from one of the origin of Ftool in Fb: through F, and over the lever to the point.
    Matrix6d from_tool;
    from_tool.leftCols<3>() = from_point.leftCols<3>() * estimate.f.rotation;
    from_tool.rightCols<3>() =
        from_point.rightCols<3>() * estimate.f.rotation - from_tool.leftCols<3>() * skew(lever);
    for (const Parameter& p : unknowns.parameters) {
      out.derivative.block<6, 1>(6 * k, c).noalias() =
          from_tool * (pose_column(p, estimate.set, model, at, response, row) * units[c]);
      ++c;
    }
  }
  return out;
}

std::vector<std::size_t> free_frames(const std::vector<Observation>& rows) {
  const bool oriented = std::ranges::any_of(rows, &Observation::has_orientation);
  std::vector<std::size_t> all(oriented ? 12 : 9);
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

double unit_of(const Parameter& parameter, const TermSet& set) {
  const Term<double>& term = set.terms[parameter.terms.front()];
  if (term.effect == Effect::geometric) return is_length(term.place) ? 1e-4 : radians(0.05);
  const auto usual_size = descriptor(term.effect).usual_size;
  return usual_size == nullptr ? 1e-4 : usual_size(term.place);
}

Eigen::VectorXd units_of(const Unknowns& unknowns, const TermSet& set) {
  Eigen::VectorXd units(static_cast<Eigen::Index>(unknowns.count()));
  Eigen::Index k = 0;
  for (const std::size_t i : unknowns.frames) units[k++] = i % 6 < 3 ? frame_length_m : frame_angle_rad;
  for (const Parameter& p : unknowns.parameters) units[k++] = unit_of(p, set);
  return units;
}

void move(Estimate& estimate, const Unknowns& unknowns, const Eigen::VectorXd& dx) {
  const Eigen::VectorXd step = dx.cwiseProduct(units_of(unknowns, estimate.set));
  Eigen::Index k = 0;
  if (!unknowns.frames.empty()) {
    Eigen::Matrix<double, 12, 1> frame = Eigen::Matrix<double, 12, 1>::Zero();
    for (const std::size_t i : unknowns.frames) frame[static_cast<Eigen::Index>(i)] = step[k++];
    estimate.f.position += frame.segment<3>(0);
    estimate.f.rotation =
        Eigen::Quaterniond(rotation_of(frame.segment<3>(3)) * estimate.f.rotation).normalized();
    estimate.e.position += frame.segment<3>(6);
    estimate.e.rotation =
        Eigen::Quaterniond(estimate.e.rotation * rotation_of(frame.segment<3>(9))).normalized();
  }
  for (const Parameter& p : unknowns.parameters) p.set(estimate.set, p.get(estimate.set) + step[k++]);
}

std::vector<std::string> names_of(const Unknowns& unknowns) {
  static const char* const axis[] = {"x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"};
  std::vector<std::string> names;
  for (const std::size_t i : unknowns.frames) {
    names.push_back(std::string(i < 6 ? "frame_f." : "frame_e.") + axis[i % 6]);
  }
  for (const Parameter& p : unknowns.parameters) names.push_back(p.name);
  return names;
}

}  // namespace flexcomp::host
