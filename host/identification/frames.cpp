// SPDX-License-Identifier: Apache-2.0
// The measurement frames F and E, Eq. (M1): start by least squares from 24 rotations, then robust refinement.
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "flexcomp/forward.hpp"
#include "identification/identifiability.hpp"
#include "identification/identify.hpp"
#include "identification/statistics.hpp"
#include "linalg/decompositions.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

/// Equations of positions, one F_p + F_R (P + N E_p) = p, and of orientations, F_R N E_R = R, each divided by its
/// standard deviation. A row of a triangular factor of many is one as well: N and R are then no rotations.
struct PositionEquation {
  Eigen::Vector3d p;
  double one;
  Eigen::Vector3d model_p;
  Eigen::Matrix3d n;
};
struct OrientationEquation {
  Eigen::Matrix3d r;
  Eigen::Matrix3d n;
};

/// The 24 rotations of a cube: each rotation is within 63 degrees of one.
Eigen::Matrix3d cube_rotation(int index) {
  const Eigen::AngleAxisd about_z(index % 4 * pi / 2, Eigen::Vector3d::UnitZ());
  const int face = index / 4;
  const Eigen::AngleAxisd top =
      face < 4 ? Eigen::AngleAxisd(face * pi / 2, Eigen::Vector3d::UnitX())
               : Eigen::AngleAxisd(face == 4 ? pi / 2 : -pi / 2, Eigen::Vector3d::UnitY());
  return (about_z * top).toRotationMatrix();
}

/// Least squares of positions and orientations together for F and E, from 24 rotations of F, Eq. (M52). Orientations about
/// one axis leave F open in rotation about it, half turns leave its sign open: the positions decide.
class FrameStart {
 public:
  FrameStart(const std::vector<Observation>& rows, const std::vector<Pose<double>>& model) {
    const auto n = static_cast<Eigen::Index>(rows.size());
    Eigen::MatrixXd u = Eigen::MatrixXd::Zero(std::max<Eigen::Index>(n, 16), 16);
    Eigen::MatrixXd v = Eigen::MatrixXd::Zero(std::max<Eigen::Index>(n, 18), 18);
    for (Eigen::Index k = 0; k < n; ++k) {
      const Observation& row = rows[static_cast<std::size_t>(k)];
      const Pose<double>& pose = model[static_cast<std::size_t>(k)];
      const double by = 1 / standard_deviation(row, 0);
      u.row(k) << by * row.p_m.transpose(), by, by * pose.position.transpose(),
          by * pose.rotation.reshaped().transpose();
      if (!row.has_orientation) continue;
      oriented_ = true;
      const double by_angle = std::sqrt(0.5) / standard_deviation(row, 3);
      v.row(k) << by_angle * row.R.reshaped().transpose(), by_angle * pose.rotation.reshaped().transpose();
    }
    u = upper_factor(u);
    v = upper_factor(v);
    for (Eigen::Index k = 0; k < u.rows(); ++k) {
      positions_.push_back({u.row(k).head<3>().transpose(), u(k, 3), u.row(k).segment<3>(4).transpose(),
                            u.row(k).tail<9>().reshaped(3, 3)});
    }
    if (!oriented_) return;
    for (Eigen::Index k = 0; k < v.rows(); ++k)
      orientations_.push_back({v.row(k).head<9>().reshaped(3, 3), v.row(k).tail<9>().reshaped(3, 3)});
  }

  struct Frames {
    Pose<double> f;
    Pose<double> e;
    double cost = 0;
  };

  /// The start of least cost. Its E is first held near zero: with a wrong rotation of F, orientations that vary by a
  /// few milliradians would move it by tens of metres.
  Frames best() const {
    Frames best;
    for (int k = 0; k < 24; ++k) {
      const Frames found = minimised(from(cube_rotation(k)), short_tool_m);
      if (k == 0 || found.cost < best.cost) best = found;
    }
    return minimised(best, long_tool_m);
  }

 private:
  using Normal = Eigen::Matrix<double, 12, 12>;
  using Vector12 = Eigen::Matrix<double, 12, 1>;

  /// Of a coordinate, declared noise and usual error of a nominal arm together. \param first  0: position, 3: orientation
  static double standard_deviation(const Observation& row, Eigen::Index first) {
    constexpr double usual = 1e-3;  // m and rad: what the nominal arm misses
    const double information = row.whitening.middleCols<3>(first).squaredNorm() / 3;
    return std::sqrt(usual * usual + 1 / information);
  }

  /// The other unknowns, given F's rotation: that of E is the nearest rotation, its translation zero.
  Frames from(const Eigen::Matrix3d& f_rotation) const {
    Frames x;
    x.f.rotation = f_rotation;
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const OrientationEquation& o : orientations_) sum += (f_rotation * o.n).transpose() * o.r;
    if (oriented_) x.e.rotation = nearest_rotation(sum);
    double squares = 0;
    for (const PositionEquation& e : positions_) {
      x.f.position += e.one * (e.p - f_rotation * e.model_p);
      squares += e.one * e.one;
    }
    x.f.position /= squares;
    return x;
  }

  /// Sum of squares; where asked for, also the normal matrix and the right side of a Gauss-Newton step.
  double squares(const Frames& x, double tool_m, Normal* normal = nullptr, Vector12* right = nullptr) const {
    const Eigen::Matrix3d& f = x.f.rotation;
    const double tool_information = 1 / (tool_m * tool_m);
    double cost = tool_information * x.e.position.squaredNorm();
    if (normal != nullptr) {
      normal->setZero();
      normal->diagonal().segment<3>(6).setConstant(tool_information);
      right->setZero();
      right->segment<3>(6) = -tool_information * x.e.position;
    }
    for (const PositionEquation& e : positions_) {
      const Eigen::Vector3d s = f * (e.model_p + e.n * x.e.position);
      const Eigen::Vector3d r = e.p - e.one * x.f.position - s;
      cost += r.squaredNorm();
      if (normal == nullptr) continue;
      Eigen::Matrix<double, 3, 9> a;
      a << e.one * Eigen::Matrix3d::Identity(), -skew(s), f * e.n;
      normal->topLeftCorner<9, 9>().noalias() += a.transpose() * a;
      right->head<9>().noalias() += a.transpose() * r;
    }
    for (const OrientationEquation& o : orientations_) {
      const Eigen::Matrix3d m = f * o.n * x.e.rotation;
      const Eigen::Matrix3d r = o.r - m;
      cost += r.squaredNorm();
      if (normal == nullptr) continue;
      Eigen::Matrix<double, 9, 6> a;
      for (int i = 0; i < 3; ++i) {
        const Eigen::Matrix3d turn = skew(Eigen::Vector3d::Unit(i));
        a.col(i) = (turn * m).reshaped();
        a.col(3 + i) = (m * turn).reshaped();
      }
      const Matrix6d square = a.transpose() * a;
      const Vector6<double> side = a.transpose() * r.reshaped();
      normal->block<3, 3>(3, 3) += square.topLeftCorner<3, 3>();
      normal->block<3, 3>(3, 9) += square.topRightCorner<3, 3>();
      normal->block<3, 3>(9, 3) += square.bottomLeftCorner<3, 3>();
      normal->block<3, 3>(9, 9) += square.bottomRightCorner<3, 3>();
      right->segment<3>(3) += side.head<3>();
      right->segment<3>(9) += side.tail<3>();
    }
    return cost;
  }

  /// Minimises the squares by Levenberg-Marquardt. \param tool_m  standard deviation of E's translation about zero
  Frames minimised(Frames x, double tool_m) const {
    Normal normal;
    Vector12 right;
    x.cost = squares(x, tool_m, &normal, &right);
    double mu = 1e-3;
    for (int round = 0; round < 50 && mu < 1e9; ++round) {
      Normal damped = normal;
      damped.diagonal() += mu * normal.diagonal();
      if (!oriented_) damped.diagonal().tail<3>().setOnes();
      const Vector12 dx = damped.ldlt().solve(right);
      Frames next = x;
      next.f.position += dx.segment<3>(0);
      next.f.rotation = rotation_of(dx.segment<3>(3)) * x.f.rotation;
      next.e.position += dx.segment<3>(6);
      next.e.rotation = x.e.rotation * rotation_of(dx.segment<3>(9));
      next.cost = squares(next, tool_m);
      if (!(next.cost < x.cost)) {
        mu *= 10;
        continue;
      }
      const bool done = x.cost - next.cost < 1e-9 * x.cost;
      x = next;
      if (done) break;
      mu *= 0.1;
      x.cost = squares(x, tool_m, &normal, &right);
    }
    return x;
  }

  static constexpr double short_tool_m = 0.01;
  static constexpr double long_tool_m = 1;  // holds what the orientations leave open

  bool oriented_ = false;
  std::vector<PositionEquation> positions_;
  std::vector<OrientationEquation> orientations_;
};

}  // namespace

Estimate fit_frames(const TermSet& set, const std::vector<Observation>& rows, const Robot& robot) {
  Estimate start{.set = set};
  const auto model = prepare(set, robot, "frames");
  std::vector<Pose<double>> poses;
  Workspace<double, joint_count> ws;
  for (const Observation& row : rows) {
    poses.push_back(forward(*model, row.q_rad, row.context, ws));
    poses.back().position += poses.back().rotation * ws.point;
  }
  const FrameStart::Frames frames = FrameStart(rows, poses).best();
  start.f = frames.f;
  start.e = frames.e;
  Unknowns unknowns;
  const std::vector<std::size_t> all = free_frames(rows);
  unknowns.frames = all;
  // Frame parameters that are not identifiable (orientations about one axis within a milliradian, too few rows) keep their
  // start: errors of the nominal arm would move them by metres.
  const Linearised lin = linearised(start, *model, rows, unknowns);
  const Elimination found = eliminate(lin.derivative, elimination_order(unknowns, set), structural_tolerance);
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
