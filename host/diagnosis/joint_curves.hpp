// SPDX-License-Identifier: Apache-2.0
/// \file
/// Curves of all joints at once as Gaussian processes over the joint's reading (D19): a size for each joint and one spectrum
/// for all, with the scale of the noise, by their marginal likelihood (D20). They carry what no name explains.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "diagnosis/subset_search.hpp"
#include "identification/prior_knowledge.hpp"
#include "measurement/observation.hpp"

namespace flexcomp::host {

/// Coefficients of a curve that is carried: knots 2.8 degrees apart.
constexpr std::size_t curve_coefficients = 128;

/// Prior of the joints' curves (D19).
struct CurvePrior {
  std::array<double, joint_count> size_rad{};  ///< standard deviation of a joint's curve; 0: it has none
  double corner = 10;                          ///< periods per turn up to which the spectrum is flat

  bool has(std::size_t joint) const { return size_rad[joint] > 0; }
};

/// Covariance of the coefficients of one joint's curve, rad^2, (D19). \param size_rad  standard deviation of the curve
Eigen::MatrixXd coefficient_covariance(double size_rad, double corner, std::size_t coefficients);

/// Coefficients of a curve that measured readings determine: not those inside a gap of more than a sixth of a turn
/// between neighbouring readings, where the curve is zero.
std::vector<bool> measured_coefficients(const std::vector<Observation>& rows, std::size_t joint,
                                        std::size_t coefficients);

/// Curves at the maximum of the marginal likelihood (D20).
struct CurveMaximum {
  double value = 0;  ///< 2 ln of the marginal likelihood, but for a constant of the system
  CurvePrior prior;
  double position_noise = 1;     ///< standard deviation of the noise over the declared one
  double orientation_noise = 1;  ///< the same of orientations
};

/// Marginal likelihood of a linear system with named blocks and curves of joints. Nuisance parameters have a flat prior;
/// parametric blocks that of as much information as one measured number has, so that a block counts as by its BIC (Kass and
/// Wasserman 1995); the others their own.
class CurveEvidence {
 public:
  CurveEvidence(const SubsetSearch& search, const std::vector<Observation>& rows, const Subset& blocks);

  /// The maximum with all blocks and joints; nothing where no curve, alone beside the blocks, gains at any of a few sizes.
  std::optional<CurveMaximum> maximum_where_any_gains() const;

  /// \param blocks  some of those that were given \param start  where the search for the maximum begins; null: a scan
  CurveMaximum maximum(const Subset& blocks, const std::array<bool, joint_count>& joints,
                       const CurveMaximum* start = nullptr) const;

  /// The value with less, all sizes and the noise as they are: at most that of maximum().
  double value_without(const Subset& blocks, const std::array<bool, joint_count>& joints,
                       const CurveMaximum& at) const;

  /// Columns of the curves and the precision of their coefficients, for LeftOutPoses.
  ChosenColumns columns_of(const CurveMaximum& at) const;

 private:
  struct Half {  ///< positions or orientations
    Eigen::MatrixXd gram;
    Eigen::VectorXd right;
    double square = 0;
    double numbers = 0;
  };
  struct Features {
    std::vector<Eigen::Index> index;
    std::vector<int> joint;  ///< of a curve's column; -1: fixed prior; -2: flat
    std::vector<int> order;
  };
  struct Point;
  Features features(const Subset& blocks, const std::array<bool, joint_count>& joints) const;
  bool evaluate(const Features& f, const Eigen::VectorXd& log_sizes, bool with_slope, Point& out) const;
  static Eigen::VectorXd logarithms(const CurveMaximum& at, const std::array<bool, joint_count>& joints);
  struct Scan {
    Eigen::VectorXd log;  ///< where to start
    double gain = 0;      ///< largest of one joint alone
  };
  Scan scan(const Subset& blocks, const std::array<bool, joint_count>& joints) const;
  CurveMaximum climb(const Features& f, Eigen::VectorXd log,
                     const std::array<bool, joint_count>& joints) const;

  Subset blocks_;
  std::vector<std::pair<Eigen::Index, Eigen::Index>> columns_of_block_;
  Eigen::Index flat_ = 0;  ///< first column of the nuisance
  Eigen::MatrixXd curves_;
  Half position_, orientation_;
};

}  // namespace flexcomp::host
