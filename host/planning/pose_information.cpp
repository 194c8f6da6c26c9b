// SPDX-License-Identifier: Apache-2.0
#include "planning/pose_information.hpp"

#include <algorithm>
#include <random>

#include "flexcomp/forward.hpp"
#include "flexcomp/identification.hpp"
#include "identification/identifiability.hpp"
#include "identification/residuals.hpp"
#include "linalg/decompositions.hpp"
#include "measurement/reflectors.hpp"

namespace flexcomp::host {

namespace {

constexpr std::size_t reference_poses = 1000;

/// Column of frame parameter i, Eq. (M32) at F = E = 1: F acts in the measurement frame, E in Ftool.
Vector6<double> frame_column(std::size_t i, const Pose<double>& pose) {
  Vector6<double> column = Vector6<double>::Zero();
  const auto axis = static_cast<Eigen::Index>(i % 3);
  const Eigen::Vector3d direction =
      i < 6 ? Eigen::Vector3d(Eigen::Vector3d::Unit(axis)) : Eigen::Vector3d(pose.rotation.col(axis));
  if (i % 6 < 3) {
    column.head<3>() = direction;
  } else {
    column.tail<3>() = direction;
    if (i < 6) column.head<3>() = direction.cross(pose.position);
  }
  return column;
}

}  // namespace

Instrument Instrument::pose(double position_sigma_m, double orientation_sigma_rad) {
  Instrument i;
  i.whitening_.diagonal() << Eigen::Vector3d::Constant(1 / position_sigma_m),
      Eigen::Vector3d::Constant(1 / orientation_sigma_rad);
  return i;
}

Instrument Instrument::position(double sigma_m) {
  Instrument i;
  i.rows_ = 3;
  i.whitening_.setZero();
  i.whitening_.diagonal().head<3>().setConstant(1 / sigma_m);
  return i;
}

Instrument Instrument::reflectors(const std::vector<Eigen::Vector3d>& template_m, double sigma_m) {
  Instrument i;
  i.isotropic_ = false;
  i.whitening_ = Llt(fit_information(Pose<double>(), template_m, sigma_m)).lower().transpose();
  return i;
}

PoseInformation::PoseInformation(const Robot& robot, ModelKind kind, bool frames,
                                 const std::vector<PlannedMeasurement>& like, std::uint64_t seed) {
  model_.prepare(robot.nominal, TermList<double>());  // no terms: nothing to refuse
  const ParametricModel paper = paper_model(robot.nominal, kind, !frames);
  parameters_of_model_ = paper.parameters.size();
  Unknowns all{.parameters = paper.parameters};
  if (frames) {
    const bool orientation =
        std::ranges::any_of(like, [](const PlannedMeasurement& s) { return s.instrument.rows() == 6; });
    for (std::size_t i = 0; i < (orientation ? 12U : 9U); ++i) all.frames.push_back(i);
  }
  frames_ = all.frames;
  const Eigen::VectorXd units = units_of(all, paper.set);
  frame_units_.assign(units.data(), units.data() + all.frames.size());
  for (std::size_t p = 0; p < paper.parameters.size(); ++p) {
    columns_.push_back({paper.set.terms[paper.parameters[p].terms.front()],
                        units[static_cast<Eigen::Index>(all.frames.size() + p)]});
  }

  std::mt19937_64 random(seed);
  Eigen::MatrixXd reference =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(6 * reference_poses), unknowns());
  Block h;
  for (std::size_t k = 0; k < reference_poses; ++k) {
    PlannedMeasurement measurement = like[k % like.size()];
    for (std::size_t j = 0; j < joint_count; ++j) {
      const JointLimits& limits = robot.nominal.limits[j];
      measurement.q_rad[j] = std::uniform_real_distribution<double>(limits.min_rad, limits.max_rad)(random);
    }
    block(measurement, h);
    reference.middleRows(static_cast<Eigen::Index>(6 * k), h.cols()) = h.transpose();
  }
  const Elimination possible = eliminate(reference, elimination_order(all, paper.set), structural_tolerance);
  const std::vector<Column> candidates = columns_;
  const std::vector<std::size_t> candidate_frames = frames_;
  columns_.clear();
  frames_.clear();
  frame_units_.clear();
  for (const std::size_t c : possible.kept) {
    if (c < candidate_frames.size()) {
      frames_.push_back(candidate_frames[c]);
      frame_units_.push_back(units[static_cast<Eigen::Index>(c)]);
      continue;
    }
    const std::size_t p = c - candidate_frames.size();
    columns_.push_back(candidates[p]);
    names_.push_back(paper.parameters[p].name);
    file_units_.push_back(candidates[p].unit / paper.parameters[p].si_per_file_unit());
  }
}

void PoseInformation::block(const Joints& q_rad, const PoseContext& context, const Instrument& instrument,
                            Block& out) const {
  Linearisation<double, joint_count> at;
  linearise(model_, q_rad, context, at);
  Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, most_unknowns> h(6, unknowns());
  Eigen::Index k = 0;
  for (const std::size_t i : frames_) {
    h.col(k) = frame_column(i, at.pose) * frame_units_[static_cast<std::size_t>(k)];
    ++k;
  }
  for (const Column& c : columns_) h.col(k++) = column(model_, at, c.term, context) * c.unit;
  const Eigen::Index rows = instrument.rows();
  out.resize(unknowns(), rows);
  if (instrument.isotropic_) {
    for (Eigen::Index r = 0; r < rows; ++r) out.col(r) = h.row(r) * instrument.whitening_(r, r);
  } else {
    // Rotate into Ftool, in which the template is constant.
    const Eigen::Matrix3d rotation = at.pose.rotation.transpose();
    Eigen::Matrix<double, 6, 6> whitening;
    whitening << instrument.whitening_.leftCols<3>() * rotation,
        instrument.whitening_.rightCols<3>() * rotation;
    out.noalias() = h.transpose() * whitening.transpose();
  }
}

}  // namespace flexcomp::host
