// SPDX-License-Identifier: Apache-2.0
/// \file
/// Search for the commands at which a correction changes fastest with the command, and what stays at random commands. For
/// tests/core/slope_test.cpp (fixed budget) and the program slope_search.
///
/// The slope at q is the 2-norm of the matrix of differences of the correction c(q) = out.q - q by a step of one joint after the
/// other. The step is 5e-6 rad: one iteration more or less changes c by 1e-9 rad, which counts as 2e-4, and a jump of 0.5 mrad
/// counts as 100. A joint that moves 0.1 rad/s goes 20 times as far in a cycle of 1 ms.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include <Eigen/LU>

#include <flexcomp/compensate.hpp>

#include "support/arms.hpp"

namespace slopes {

using arms::Joints;

constexpr double step_rad = 5e-6;  ///< of each joint, for differences

/// An arm with a set and settings.
struct Subject {
  arms::Robot robot;
  flexcomp::Model<double> model;
  flexcomp::Context<double> context;
  flexcomp::CompensationSettings<double> settings;
  arms::NominalJacobian jacobian;
};

/// An arm with Table 1 of the paper times `scale`.
inline Subject subject(const arms::Arm& arm, const flexcomp::CompensationSettings<double>& settings = {},
                       double scale = 1) {
  return {arm.robot, arms::prepared(arm.robot, arms::table1(arm, scale)),
          flexcomp::default_context<double>(arm.robot), settings, arms::NominalJacobian(arm.robot)};
}

/// An arm whose axis 4 wobbles, by `size` rad and `order` times a turn: the link moves, and the wrist follows it.
inline Subject with_wobble(const arms::Arm& arm, double size, double order) {
  arms::TermSet<double> set = arms::table1(arm);
  set.add(arms::on_link(4, flexcomp::slot::alpha), flexcomp::Basis::sine, size, 3, order);
  return {arm.robot,
          arms::prepared(arm.robot, set),
          flexcomp::default_context<double>(arm.robot),
          {},
          arms::NominalJacobian(arm.robot)};
}

inline double norm(const Joints& v) {
  double sum = 0;
  for (const double x : v) sum += x * x;
  return std::sqrt(sum);
}

/// Correction of a command, rad.
inline Joints correction_at(const Subject& s, const Joints& q) {
  flexcomp::Compensated<double, 6> out;
  flexcomp::compensate(s.model, q, s.context, s.settings, out);
  Joints c{};
  for (std::size_t i = 0; i < 6; ++i) c[i] = out.q[i] - q[i];
  return c;
}

/// Slope of the correction over the command, 2-norms.
inline double slope_at(const Subject& s, const Joints& q, double step = step_rad) {
  const Joints c = correction_at(s, q);
  std::array<Joints, 6> column{};
  Joints u{};
  for (std::size_t j = 0; j < 6; ++j) {
    Joints moved = q;
    moved[j] += step;
    const Joints d = correction_at(s, moved);
    for (std::size_t i = 0; i < 6; ++i) column[j][i] = (d[i] - c[i]) / step;
    if (norm(column[j]) > norm(u)) u = column[j];
  }
  // The greatest singular value by the power iteration, from the longest column.
  double slope = norm(u);
  for (int n = 0; n < 10 && slope > 0; ++n) {
    Joints v{};
    Joints next{};
    for (std::size_t j = 0; j < 6; ++j)
      for (std::size_t i = 0; i < 6; ++i) v[j] += column[j][i] * u[i];
    const double length = norm(v);
    if (!(length > 0)) break;
    for (std::size_t j = 0; j < 6; ++j)
      for (std::size_t i = 0; i < 6; ++i) next[i] += column[j][i] * v[j] / length;
    u = next;
    slope = norm(u);
  }
  return slope;
}

/// About standard normal: the sum of twelve uniform numbers.
inline double normal(arms::Random& random) {
  double sum = -6;
  for (int k = 0; k < 12; ++k) sum += random.uniform(0, 1);
  return sum;
}

/// Moves every joint inside its limits by more than any correction, so that none is held there.
inline void keep_inside(const arms::Robot& robot, Joints& q) {
  constexpr double margin_rad = 0.11;
  for (std::size_t i = 0; i < 6; ++i)
    q[i] =
        std::min(std::max(q[i], robot.limits[i].min_rad + margin_rad), robot.limits[i].max_rad - margin_rad);
}

/// Moves one joint to the nearest zero of the determinant of the nominal Jacobian within 1.6 rad, if there is one.
inline void to_singularity(const Subject& s, std::size_t joint, Joints& q) {
  constexpr double width = 0.1;
  const double from = q[joint];
  const auto is_negative = [&](double v) {
    q[joint] = v;
    return s.jacobian(q).determinant() < 0;
  };
  const bool here = is_negative(from);
  for (int k = 1; k <= 16; ++k) {
    for (const double side : {width, -width}) {
      if (is_negative(from + side * k) == here) continue;
      double low = from + side * (k - 1);
      double high = from + side * k;
      for (int n = 0; n < 30; ++n) {
        const double middle = (low + high) / 2;
        (is_negative(middle) == here ? low : high) = middle;
      }
      q[joint] = low;
      return;
    }
  }
  q[joint] = from;
}

/// A pose to start from: any, or near one or several singularities at once, at any distance.
inline Joints start(const Subject& s, arms::Random& random) {
  Joints q = random.pose(s.robot);
  keep_inside(s.robot, q);
  const std::uint64_t kind = random.bits();
  if ((kind & 1U) != 0) {  // wrist; an arm that turns joint 5 by a turn has three zeros there
    const double turns = s.robot.limits[4].max_rad > 4 ? static_cast<double>(random.below(3)) - 1 : 0;
    q[4] = turns * 180 * arms::deg + (random.below(2) == 0 ? 1 : -1) * std::pow(10, random.uniform(-5, -0.3));
  }
  for (const std::size_t joint : {std::size_t{2}, std::size_t{1}, std::size_t{3}})
    if ((kind >> joint & 1U) != 0) to_singularity(s, joint, q);
  const double size = std::pow(10, random.uniform(-5, -0.5));
  for (double& v : q) v += size * normal(random);
  keep_inside(s.robot, q);
  return q;
}

/// Greatest slope of a search, and where it is.
struct Found {
  double slope = 0;
  Joints q{};
};

/// Local ascent from `here` by random steps whose size follows their success: a (1+1) evolution strategy.
inline void ascend(const Subject& s, arms::Random& random, int steps, double step, Found& here) {
  double size = 0.02;
  for (int n = 0; n < steps && size > 1e-9; ++n) {
    Joints q = here.q;
    const std::size_t only = random.below(12);  // all joints, or one of them
    const double scale = random.below(4) == 0 ? size * std::pow(10, random.uniform(-3, 1)) : size;
    for (std::size_t i = 0; i < 6; ++i)
      if (only >= 6 || only == i) q[i] += scale * normal(random);
    keep_inside(s.robot, q);
    const double slope = slope_at(s, q, step);
    size *= slope > here.slope ? 1.5 : 0.92;
    if (slope > here.slope) here = {slope, q};
  }
}

/// Evaluations of the slope that one call of climb() takes at most.
constexpr int climb_evaluations = 420;

/// One search: the steepest of 20 starts, and ascent from there.
inline void climb(const Subject& s, arms::Random& random, double step, Found& best) {
  Found here;
  for (int n = 0; n < 20; ++n) {
    const Joints q = start(s, random);
    const double slope = slope_at(s, q, step);
    if (slope > here.slope) here = {slope, q};
  }
  ascend(s, random, climb_evaluations - 20, step, here);
  if (here.slope > best.slope) best = here;
}

/// What stays at random poses. Those at which a joint is held at its limit are left out.
struct Share {
  int poses = 0;
  double held = 0;         ///< share that is not answered `ok`
  double position = 0;     ///< share with more than 0.02 mm left
  double orientation = 0;  ///< share with more than 1 mrad left
  double most_m = 0;       ///< largest position error left
  double most_rad = 0;     ///< largest orientation error left
  double worse = 0;        ///< share whose position is farther off than uncorrected
  double worse_m = 0;      ///< by at most
};

inline Share share(const Subject& s, int poses, std::uint64_t seed) {
  arms::Random random(seed);
  Share out;
  for (int n = 0; n < poses; ++n) {
    const Joints q = random.pose(s.robot);
    const auto done = flexcomp::compensate(s.model, q, s.context, s.settings);
    if (done.status == flexcomp::StepStatus::at_limit) continue;
    ++out.poses;
    if (done.status != flexcomp::StepStatus::ok) ++out.held;
    const auto after = flexcomp::target_residual(s.model, done.q, q, s.context);
    const double before_m = flexcomp::target_residual(s.model, q, q, s.context).position_m;
    if (after.position_m > 20e-6) ++out.position;
    if (after.orientation_rad > 1e-3) ++out.orientation;
    if (after.position_m > before_m) ++out.worse;
    out.most_m = std::max(out.most_m, after.position_m);
    out.most_rad = std::max(out.most_rad, after.orientation_rad);
    out.worse_m = std::max(out.worse_m, after.position_m - before_m);
  }
  for (double* v : {&out.held, &out.position, &out.orientation, &out.worse}) *v /= out.poses;
  return out;
}

}  // namespace slopes
