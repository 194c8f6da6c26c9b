// SPDX-License-Identifier: Apache-2.0
// The measurement frames F and E, Eq. (M2): start in closed form, then refinement.
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "flexcomp/forward.hpp"
#include "identification/identifiability.hpp"
#include "identification/identify.hpp"
#include "identification/statistics.hpp"
#include "linalg/decompositions.hpp"
#include "measurement/reflectors.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

/// Solves R_k = F N_k E for the rotations of F and E by alternating nearest rotations from 24 starts (rotations
/// of a cube).
void align_rotations(const std::vector<Observation>& rows, const std::vector<Pose<double>>& model,
                     Pose<double>& f, Pose<double>& e) {
  double best = -1;
  for (int start = 0; start < 24; ++start) {
    Eigen::Matrix3d e_rotation =
        (Eigen::AngleAxisd(start % 4 * pi / 2, Eigen::Vector3d::UnitZ()) *
         (start / 4 < 4 ? Eigen::AngleAxisd(start / 4 * pi / 2, Eigen::Vector3d::UnitX())
                        : Eigen::AngleAxisd(start / 4 == 4 ? pi / 2 : -pi / 2, Eigen::Vector3d::UnitY())))
            .toRotationMatrix();
    Eigen::Matrix3d f_rotation = Eigen::Matrix3d::Identity();
    double fitness = 0;
    for (int round = 0; round < 100; ++round) {
      Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
      for (std::size_t k = 0; k < rows.size(); ++k) {
        if (rows[k].has_orientation) sum += rows[k].R * (model[k].rotation * e_rotation).transpose();
      }
      f_rotation = nearest_rotation(sum);
      sum.setZero();
      for (std::size_t k = 0; k < rows.size(); ++k) {
        if (rows[k].has_orientation) sum += (f_rotation * model[k].rotation).transpose() * rows[k].R;
      }
      e_rotation = nearest_rotation(sum);
      const double now = (e_rotation.transpose() * sum).trace();
      if (now - fitness < 1e-9 * now && round > 0) break;
      fitness = now;
    }
    if (fitness > best) {
      best = fitness;
      f.rotation = f_rotation;
      e.rotation = e_rotation;
    }
  }
}

/// Solves p_k = F_p + F_R (P_k + N_k E_p) for F_p and E_p by linear least squares, F_R given.
void solve_translations(const std::vector<Observation>& rows, const std::vector<Pose<double>>& model,
                        Pose<double>& f, Pose<double>& e) {
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Vector6<double> right = Vector6<double>::Zero();
  for (std::size_t k = 0; k < rows.size(); ++k) {
    Eigen::Matrix<double, 3, 6> a;
    a << Eigen::Matrix3d::Identity(), f.rotation * model[k].rotation;
    normal += a.transpose() * a;
    right += a.transpose() * (rows[k].p_m - f.rotation * model[k].position);
  }
  // With one orientation only the sum of the two is identifiable: the minimum-norm solution.
  const Vector6<double> x = shortest_least_squares(normal, right);
  f.position = x.head<3>();
  e.position = x.tail<3>();
}

}  // namespace

Estimate fit_frames(const TermSet& set, const std::vector<Observation>& rows, const Robot& robot) {
  Estimate start{.set = set};
  const auto model = prepare(set, robot, "frames");
  std::vector<Pose<double>> poses;
  Points measured;
  Workspace<double, joint_count> ws;
  bool oriented = false;
  for (const Observation& row : rows) {
    poses.push_back(forward(*model, row.q_rad, row.context, ws));
    measured.push_back(row.p_m);
    oriented = oriented || row.has_orientation;
  }
  if (oriented) {
    align_rotations(rows, poses, start.f, start.e);
    solve_translations(rows, poses, start.f, start.e);
  } else {
    // Alternates between the rigid fit of the points and the tool point that fits the residual.
    for (int round = 0; round < 200; ++round) {
      Points points;
      for (const Pose<double>& p : poses) points.push_back(p.position + p.rotation * start.e.position);
      start.f = fit_rigid(measured, points).pose;
      const Eigen::Vector3d before = start.e.position;
      solve_translations(rows, poses, start.f, start.e);
      if ((start.e.position - before).norm() < 1e-7) break;
    }
  }
  Unknowns unknowns;
  const std::vector<std::size_t> all = free_frames(rows);
  unknowns.frames = all;
  // Frame parameters that are not identifiable (one orientation, too few rows) keep their start.
  const Linearised lin = linearised(start, *model, rows, unknowns);
  const Elimination found = eliminate(lin.derivative, elimination_order(unknowns, set));
  unknowns.frames.clear();
  for (const std::size_t c : found.kept) unknowns.frames.push_back(all[c]);
  if (unknowns.frames.empty()) return start;
  return fit(start, unknowns, rows, robot).estimate;
}

bool nominal_frames_are_off(const std::vector<RowResidual>& nominal, const std::vector<Observation>& rows) {
  std::vector<double> position;
  std::vector<double> orientation;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    position.push_back(nominal[k].position_m.norm());
    if (rows[k].has_orientation) orientation.push_back(nominal[k].orientation_rad.norm());
  }
  return median(position) > 0.020 || median(orientation) > radians(2);
}

}  // namespace flexcomp::host
