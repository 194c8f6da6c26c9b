#include "measurement/reflectors.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <cmath>

namespace flexcomp::host {

namespace {

Eigen::Vector3d centroid(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) sum += p;
  return sum / static_cast<double>(points.size());
}

Points transformed(const Pose<double>& pose, std::span<const Eigen::Vector3d> points) {
  Points out;
  for (const Eigen::Vector3d& p : points) out.emplace_back(pose.rotation * p + pose.position);
  return out;
}

Pose<double> inverse(const Pose<double>& pose) {
  return {pose.rotation.transpose(), -(pose.rotation.transpose() * pose.position)};
}

}  // namespace

RigidFit fit_rigid(std::span<const Eigen::Vector3d> measured_m, std::span<const Eigen::Vector3d> template_m) {
  const Eigen::Vector3d from = centroid(template_m);
  const Eigen::Vector3d to = centroid(measured_m);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t k = 0; k < template_m.size(); ++k) {
    covariance += (measured_m[k] - to) * (template_m[k] - from).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  // Three or four points in a plane leave the third direction open: the determinant says which way it must point.
  Eigen::Matrix3d handed = Eigen::Matrix3d::Identity();
  handed(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  RigidFit fit;
  fit.pose.rotation = svd.matrixU() * handed * svd.matrixV().transpose();
  fit.pose.position = to - fit.pose.rotation * from;
  for (std::size_t k = 0; k < template_m.size(); ++k) {
    fit.squares_m2 += (measured_m[k] - fit.pose.rotation * template_m[k] - fit.pose.position).squaredNorm();
  }
  return fit;
}

Pose<double> reflector_frame(std::span<const Eigen::Vector3d> points_m) {
  const Eigen::Vector3d& a = points_m[0];
  const Eigen::Vector3d& b = points_m[1];
  const Eigen::Vector3d& c = points_m[2];
  Pose<double> frame;
  const Eigen::Vector3d y = (a - c).normalized();
  frame.position = c + y * y.dot(b - c);
  const Eigen::Vector3d x = (frame.position - b).normalized();
  frame.rotation.col(0) = x;
  frame.rotation.col(1) = y;
  frame.rotation.col(2) = x.cross(y);
  return frame;
}

Points estimate_template(const std::vector<Points>& rows_m) {
  Points shape = transformed(inverse(reflector_frame(rows_m.front())), rows_m.front());
  // Every row is laid onto the mean and a new mean is taken. The first step already leaves only the square of the noise
  // relative to the size; twenty are cheap.
  for (int k = 0; k < 20; ++k) {
    Points sum(shape.size(), Eigen::Vector3d::Zero());
    for (const Points& row : rows_m) {
      const Points laid = transformed(inverse(fit_rigid(row, shape).pose), row);
      for (std::size_t r = 0; r < sum.size(); ++r) sum[r] += laid[r];
    }
    double change = 0;
    for (std::size_t r = 0; r < sum.size(); ++r) {
      sum[r] /= static_cast<double>(rows_m.size());
      change += (sum[r] - shape[r]).squaredNorm();
    }
    shape = sum;
    if (change < 1e-24) break;
  }
  return transformed(inverse(reflector_frame(shape)), shape);
}

bool on_one_line(std::span<const Eigen::Vector3d> points_m) {
  const Eigen::Vector3d along = points_m[2] - points_m[0];
  const double length = along.norm();
  return length < 1e-4 || along.cross(points_m[1] - points_m[0]).norm() / length < 1e-4;
}

Eigen::Matrix<double, 6, 6> fit_information(const Pose<double>& pose,
                                            std::span<const Eigen::Vector3d> template_m, double sigma_m) {
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  for (const Eigen::Vector3d& t : template_m) {
    const Eigen::Vector3d r = pose.rotation * t;
    // A point moves by dp + phi x r.
    Eigen::Matrix<double, 3, 6> j;
    j.leftCols<3>().setIdentity();
    j.rightCols<3>() << 0, r.z(), -r.y(), -r.z(), 0, r.x(), r.y(), -r.x(), 0;
    information += j.transpose() * j;
  }
  return information / (sigma_m * sigma_m);
}

double misfit_probability(double chi2, std::size_t dof) {
  // Closed forms: three points leave 9 - 6 degrees of freedom, four 12 - 6.
  const double half = chi2 / 2;
  if (dof == 6) return std::exp(-half) * (1 + half + half * half / 2);
  return std::erfc(std::sqrt(half)) + std::sqrt(half / std::acos(-1.0)) * 2 * std::exp(-half);
}

std::size_t suspect_reflector(std::span<const Eigen::Vector3d> measured_m,
                              std::span<const Eigen::Vector3d> template_m) {
  const std::size_t n = template_m.size();
  std::size_t suspect = 0;
  double least = -1;
  for (std::size_t leave = 0; leave < n; ++leave) {
    // Distances among the others: those that do not involve the one that moved are unchanged.
    double change = 0;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = i + 1; j < n; ++j) {
        if (i == leave || j == leave) continue;
        const double d = (measured_m[i] - measured_m[j]).norm() - (template_m[i] - template_m[j]).norm();
        change += d * d;
      }
    }
    if (least < 0 || change < least) {
      least = change;
      suspect = leave;
    }
  }
  return suspect;
}

}  // namespace flexcomp::host
