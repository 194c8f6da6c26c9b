// SPDX-License-Identifier: Apache-2.0
#include "studies/paper.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <numeric>

#include "files/robot_file.hpp"
#include "flexcomp/forward.hpp"
#include "identification/identifiability.hpp"
#include "model/host_model.hpp"
#include "model/paper_model.hpp"
#include "studies/robot_texts.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

// Chen, Table 1. Links 1 to 6; places that a link does not have are skipped.
constexpr std::array<double, 6> theta_deg{-0.08, -0.04, 0.05, 0.03, 0.06, -0.1};
constexpr std::array<double, 6> d_mm{-0.4, 0, 0.2, -0.1, 0.1, -0.3};
constexpr std::array<double, 6> a_mm{0.09, -0.05, -0.1, 0.06, -0.08, 0.03};
constexpr std::array<double, 6> alpha_deg{0.03, 0.02, -0.05, -0.008, 0.01, 0.07};
constexpr double beta2_deg = 0.03;
constexpr std::array<double, 3> base_mm{0.3, -0.2, 0.1};
constexpr std::array<double, 3> base_deg{0.02, 0.01, 0.01};  // rx, ry, rz: alpha_b, beta_b, theta_b
constexpr std::array<double, 6> stiffness_n_mm_per_rad{1.47e10, 6.67e7, 3.13e7, 2.22e7, 1.18e6, 7.69e5};
constexpr std::array<double, 3> gravity_rad{0.0015, 0.00123, 0.00054};

double table1(const Term<double>& term) {
  const std::size_t i = term.place.body - 1U;
  if (term.effect == Effect::joint_compliance) return 1e3 / stiffness_n_mm_per_rad[term.joint];
  if (term.place.body == body::base) {
    return term.place.slot <= slot::z ? base_mm[term.place.slot] * 1e-3
                                      : radians(base_deg[term.place.slot - slot::rx]);
  }
  switch (term.place.slot) {
    case slot::theta:
      return radians(theta_deg[i]);
    case slot::d:
      return d_mm[i] * 1e-3;
    case slot::a:
      return a_mm[i] * 1e-3;
    case slot::alpha:
      return radians(alpha_deg[i]);
    default:
      return radians(beta2_deg);
  }
}

TermSet table1_of(const Robot& robot) {
  TermSet set = paper_model(robot.nominal, ModelKind::full, true).set;
  std::size_t k = 0;
  for (Term<double>& term : set.terms)
    term.coefficient = term.effect == Effect::link_gravity ? gravity_rad[k++] : table1(term);
  return set;
}

}  // namespace

StudiedArm paper_tx60l() {
  StudiedArm arm;
  arm.name = "TX60L";
  arm.robot = parse_robot(tx60l_yaml, "tx60l.yaml");
  arm.truth = table1_of(arm.robot);
  arm.about = "TX60L: the errors of Table 1.";
  return arm;
}

StudiedArm paper_rx160l() {
  constexpr double measured_before_m = 3.72e-3;
  constexpr double stiffer = 20;
  constexpr std::size_t whole_workspace = 4000;
  StudiedArm arm;
  arm.name = "RX160L";
  arm.robot = parse_robot(rx160l_yaml, "rx160l.yaml");
  arm.truth = table1_of(arm.robot);
  for (Term<double>& term : arm.truth.terms) {
    if (term.effect == Effect::joint_compliance) term.coefficient /= stiffer;
  }
  return scaled_to(arm, measured_before_m, random_poses(arm, whole_workspace, 20190107));
}

StudiedArm scaled_to(const StudiedArm& arm, double mean_error_m, const std::vector<StudiedPose>& poses) {
  const auto with = [&](double factor) {
    StudiedArm scaled = arm;
    for (Term<double>& term : scaled.truth.terms) {
      if (term.effect != Effect::joint_compliance) term.coefficient *= factor;
    }
    return scaled;
  };
  // The error is nearly proportional to the factor: the iteration converges in a few steps.
  double factor = 1;
  for (int k = 0; k < 20; ++k) factor *= mean_error_m / mean_error_before_m(with(factor), poses);
  StudiedArm scaled = with(factor);
  scaled.about = fmt::format(
      "{}: Table 1 with compliances of {:.3g} rad/(N·m) at joint 2, payload {} kg, all else "
      "times {:.3f}, so that the nominal arm misses by {:.2f} mm in the mean over {} poses.",
      arm.name,
      [&] {
        for (const Term<double>& t : scaled.truth.terms)
          if (t.effect == Effect::joint_compliance && t.joint == 1) return t.coefficient;
        return 0.0;
      }(),
      arm.robot.nominal.payload_kg, factor, mean_error_before_m(scaled, poses) * 1e3, poses.size());
  return scaled;
}

std::vector<double> errors_before_m(const StudiedArm& arm, const TermSet& truth,
                                    const std::vector<StudiedPose>& poses) {
  const auto model = prepare(truth, arm.robot, arm.name);
  auto context = default_context<double>(arm.robot.nominal);
  Workspace<double, joint_count> ws;
  std::vector<double> errors;
  for (const StudiedPose& pose : poses) {
    context.payload_kg = pose.payload_kg;
    const Eigen::Vector3d reached = forward(*model, pose.q_rad, context, ws).position;
    errors.push_back((reached - nominal_forward(*model, pose.q_rad).position).norm());
  }
  return errors;
}

double mean_error_before_m(const StudiedArm& arm, const std::vector<StudiedPose>& poses) {
  const std::vector<double> errors = errors_before_m(arm, arm.truth, poses);
  return std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(poses.size());
}

std::vector<StudiedPose> random_poses(const StudiedArm& arm, std::size_t count, std::uint64_t seed,
                                      const std::vector<double>& payloads_kg) {
  Observation like;
  like.context = default_context<double>(arm.robot.nominal);
  std::vector<StudiedPose> poses;
  for (const Observation& row : random_observations(arm.robot, {like}, count, seed)) {
    const double payload =
        payloads_kg.empty() ? arm.robot.nominal.payload_kg : payloads_kg[poses.size() % payloads_kg.size()];
    poses.push_back({row.q_rad, payload});
  }
  return poses;
}

TermSet part_of_table1(const StudiedArm& arm, ErrorKind kind, double factor) {
  TermSet part;
  const std::uint8_t wanted = kind == ErrorKind::joint_angles ? slot::theta : slot::d;
  for (Term<double> term : arm.truth.terms) {
    const bool on_link = term.place.body >= 1 && term.place.body <= joint_count;
    if (term.effect != Effect::geometric || !on_link || term.place.slot != wanted) continue;
    term.coefficient *= factor;
    part.terms.push_back(term);
  }
  return part;
}

}  // namespace flexcomp::host
