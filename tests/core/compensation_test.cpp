// SPDX-License-Identifier: Apache-2.0
// Inverse compensation: exact where the arm is regular; continuous, bounded and within limits everywhere.
#include <flexcomp/compensate.hpp>

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "support/random_terms.hpp"

namespace {

using arms::Joints;
using arms::part;
using flexcomp::Compensated;
using flexcomp::Model;
using flexcomp::StepStatus;

constexpr double largest_correction_rad = 0.1;  // the default of CompensationSettings

template <class S>
bool within_limits(const Model<S>& model, const std::array<S, 6>& q) {
  for (std::size_t i = 0; i < 6; ++i)
    if (!(q[i] >= model.lower(i) && q[i] <= model.upper(i))) return false;
  return true;
}

/// Largest joint correction, rad.
template <class S>
S correction(const std::array<S, 6>& q, const std::array<S, 6>& command) {
  S most = 0;
  for (std::size_t i = 0; i < 6; ++i) most = std::max(most, std::abs(q[i] - command[i]));
  return most;
}

// --- regular poses ----------------------------------------------------------------------------------------

struct Figures {
  double before_m = 0;
  double position_m = 0;
  double orientation_rad = 0;
  double float_position_m = 0;
  double float_orientation_rad = 0;
  int at_limit = 0;
};

/// Over 100,000 random poses whose smallest singular value (lengths in m) is at least 0.1.
Figures regular_poses(const arms::Robot& robot, const arms::TermSet<double>& set) {
  constexpr int poses = 100000 / part;
  arms::Random random(21);
  const auto model = arms::prepared(robot, set);
  const auto single = arms::prepared(robot, arms::as<float>(set));
  const auto context = flexcomp::default_context<double>(robot);
  const auto single_context = flexcomp::default_context<float>(robot);
  const arms::NominalJacobian jacobian(robot);
  Figures f;
  for (int n = 0; n < poses;) {
    const Joints q = random.pose(robot);
    if (!jacobian.is_regular(q)) continue;
    ++n;
    f.before_m = std::max(f.before_m, flexcomp::target_residual(model, q, q, context).position_m);
    const Compensated<double, 6> out = flexcomp::compensate(model, q, context);
    if (out.status == StepStatus::at_limit) {
      // Exactly at the limit, which the corrected command would have passed.
      ++f.at_limit;
      bool limited = false;
      for (std::size_t i = 0; i < 6; ++i)
        limited = limited || out.q[i] == model.lower(i) || out.q[i] == model.upper(i);
      EXPECT_TRUE(limited && within_limits(model, out.q));
    } else {
      EXPECT_EQ(out.status, StepStatus::ok);
      const auto left = flexcomp::target_residual(model, out.q, q, context);
      f.position_m = std::max(f.position_m, left.position_m);
      f.orientation_rad = std::max(f.orientation_rad, left.orientation_rad);
    }
    const std::array<float, 6> q_single = arms::as<float>(q);
    const Compensated<float, 6> rough = flexcomp::compensate(single, q_single, single_context);
    if (rough.status != StepStatus::at_limit) {
      EXPECT_EQ(rough.status, StepStatus::ok);
      const auto left =
          flexcomp::target_residual(model, arms::as<double>(rough.q), arms::as<double>(q_single), context);
      f.float_position_m = std::max(f.float_position_m, left.position_m);
      f.float_orientation_rad = std::max(f.float_orientation_rad, left.orientation_rad);
    }
  }
  return f;
}

/// A set on a robot, and the bounds of what compensation may leave at regular poses.
struct RegularCase {
  std::string what;
  arms::Robot robot;
  arms::TermSet<double> set;
  double position_m, orientation_rad;
};

arms::TermSet<double> with_curves(const arms::Arm& arm) {
  arms::Random random(22);
  arms::TermSet<double> set = arms::table1(arm);
  arms::add_joint_curves(set, random, 300e-6);
  return set;
}

void expect_corrected(const RegularCase& c) {
  SCOPED_TRACE(c.what);
  const Figures f = regular_poses(c.robot, c.set);
  std::printf(
      "[ measured ] %s: %.1f mm before; %.1e m, %.1e rad after; float %.1e m, %.1e rad; %d at a limit\n",
      c.what.c_str(), 1e3 * f.before_m, f.position_m, f.orientation_rad, f.float_position_m,
      f.float_orientation_rad, f.at_limit);
  EXPECT_LT(f.at_limit, 1000);
  EXPECT_LE(f.float_position_m, 2e-6);
  EXPECT_LE(f.float_orientation_rad, 3e-6);
  EXPECT_LE(f.position_m, c.position_m);
  EXPECT_LE(f.orientation_rad, c.orientation_rad);
}

TEST(Compensation, RegularPosesOfTheTx60l) {
  const arms::Arm& arm = arms::all()[0];
  expect_corrected({"TX60L, Table 1", arm.robot, arms::table1(arm), 1e-9, 1e-9});
  expect_corrected({"TX60L, Table 1 and 300 urad curves", arm.robot, with_curves(arm), 2e-9, 5e-9});
}

TEST(Compensation, RegularPosesOfAnArmWithAShoulderOffset) {
  const arms::Arm& arm = arms::all()[1];
  arms::Robot light = arm.robot;
  light.payload_kg = 1.108;
  expect_corrected({"RX160L, Table 1, 1.108 kg", light, arms::table1(arm), 1e-9, 1e-9});
  // Its own payload on the small arm's soft joints bends it by 14 mm.
  expect_corrected({"RX160L, Table 1, 6.23 kg", arm.robot, arms::table1(arm), 2e-9, 5e-9});
  expect_corrected({"RX160L, Table 1, 6.23 kg and 300 urad curves", arm.robot, with_curves(arm), 2e-9, 5e-9});
}

TEST(Compensation, RegularPosesOfAnArmWithoutASphericalWrist) {
  const arms::Arm& arm = arms::all()[2];
  expect_corrected({"UR10, Table 1", arm.robot, arms::table1(arm), 1e-9, 1e-9});
  expect_corrected({"UR10, Table 1 and 300 urad curves", arm.robot, with_curves(arm), 2e-9, 5e-9});
}

// What the step says remains, against the forward model: at every pose, singular ones and limits among them.
TEST(Compensation, SaysWhatRemains) {
  arms::Random random(23);
  for (const arms::Arm& arm : arms::all()) {
    for (const double scale : {1.0, 10.0}) {
      arms::TermSet<double> set = arms::table1(arm, scale);
      arms::add_joint_curves(set, random, 300e-6);
      const auto model = arms::prepared(arm.robot, set);
      const auto context = flexcomp::default_context<double>(arm.robot);
      double most = 0, beyond_m = 0, beyond_rad = 0, times = 0;
      int held = 0;
      for (int n = 0; n < 50000 / part; ++n) {
        const Joints q = random.pose(arm.robot);
        const Compensated<double, 6> out = flexcomp::compensate(model, q, context);
        const auto left = flexcomp::target_residual(model, out.q, q, context);
        const double factor = scale > 1 ? 1.5 : 1.05;
        beyond_m = std::max(beyond_m, left.position_m - factor * out.remaining_position_m);
        beyond_rad = std::max(beyond_rad, left.orientation_rad - factor * out.remaining_orientation_rad);
        most = std::max(most, left.position_m);
        if (left.position_m > 1e-4) {
          ++held;
          EXPECT_NE(out.flags, 0) << "said nothing of " << left.position_m << " m";
          times += out.remaining_position_m / left.position_m;
        }
      }
      std::printf(
          "[ measured ] %s x%g: up to %.1e m remain; beyond what is said %.1e m, %.1e rad; said / true in "
          "the mean %.1f "
          "(%d poses above 0.1 mm)\n",
          arm.name, scale, most, beyond_m, beyond_rad, times / std::max(1, held), held);
      EXPECT_LE(beyond_m, scale > 1 ? 1e-6 : 2e-7);
      EXPECT_LE(beyond_rad, scale > 1 ? 1e-6 : 2e-7);
    }
  }
}

// --- singularities ----------------------------------------------------------------------------------------

enum Singularity { wrist, elbow, shoulder };
constexpr const char* names[] = {"wrist", "elbow", "shoulder"};

/// A random pose at which the determinant of the nominal Jacobian changes its sign for this reason alone.
Joints singular_pose(const arms::Robot& robot, const arms::NominalJacobian& jacobian, Singularity kind,
                     arms::Random& random) {
  const std::size_t moved = kind == wrist ? 4 : kind == elbow ? 2 : 1;
  for (;;) {
    Joints q = random.pose(robot);
    for (std::size_t i = 0; i < 6; ++i) {
      const double middle = (robot.limits[i].min_rad + robot.limits[i].max_rad) / 2;
      q[i] = middle + 0.75 * (q[i] - middle);
    }
    if (kind != wrist && std::abs(std::sin(q[4])) < 0.3) continue;
    if (kind != elbow && std::abs(std::sin(q[2])) < 0.3) continue;
    const auto determinant = [&](double v) {
      q[moved] = v;
      return jacobian(q).determinant();
    };
    // The wrist is singular at q5 = 0, the elbow near q3 = 0; the shoulder where q2 says so.
    double low = kind == shoulder ? q[moved] - 0.3 : -0.2;
    double high = kind == shoulder ? q[moved] + 0.3 : 0.25;
    const bool negative = determinant(low) < 0;
    if ((determinant(high) < 0) == negative) continue;
    for (int k = 0; k < 60; ++k) {
      const double middle = (low + high) / 2;
      ((determinant(middle) < 0) == negative ? low : high) = middle;
    }
    q[moved] = low;
    return q;
  }
}

/// What a path met at its worst.
struct Passage {
  double before_m = 0;            ///< uncompensated
  double before_rad = 0;          ///< uncompensated
  double position_m = 0;          ///< compensated
  double orientation_rad = 0;     ///< compensated
  double worse_m = 0;             ///< compensated beyond uncompensated
  double lipschitz = 0;           ///< change of the correction per change of the command (2-norms)
  double correction_rad = 0;      ///< of any joint
  double at_singularity_m = 0;    ///< position error within 1e-3 rad of the singularity
  double at_singularity_rad = 0;  ///< orientation error there
  bool within_limits = true;
  int refused = 0;
};

void pass(const Model<double>& model, const flexcomp::Context<double>& context, const Joints& middle,
          const Joints& direction, double reach_rad, int steps, Passage& worst) {
  Joints last{};
  Joints last_correction{};
  bool have_last = false;
  double length = 0;
  for (const double d : direction) length += d * d;
  length = std::sqrt(length);
  for (int s = -steps / 2; s <= steps / 2; ++s) {
    Joints q{};
    const double along = reach_rad * s / (steps / 2);
    for (std::size_t i = 0; i < 6; ++i) q[i] = middle[i] + direction[i] / length * along;
    if (!within_limits(model, q)) {
      have_last = false;
      continue;
    }
    const Compensated<double, 6> out = flexcomp::compensate(model, q, context);
    if (out.status == StepStatus::refused) ++worst.refused;
    worst.within_limits = worst.within_limits && within_limits(model, out.q);
    worst.correction_rad = std::max(worst.correction_rad, correction(out.q, q));
    Joints change{};
    double change_of_change = 0;
    double step = 0;
    for (std::size_t i = 0; i < 6; ++i) {
      change[i] = out.q[i] - q[i];
      change_of_change += (change[i] - last_correction[i]) * (change[i] - last_correction[i]);
      step += (q[i] - last[i]) * (q[i] - last[i]);
    }
    if (have_last) worst.lipschitz = std::max(worst.lipschitz, std::sqrt(change_of_change / step));
    last = q;
    last_correction = change;
    have_last = true;
    if (out.status == StepStatus::at_limit) continue;  // a joint that may not move cannot serve the pose
    const auto before = flexcomp::target_residual(model, q, q, context);
    const auto after = flexcomp::target_residual(model, out.q, q, context);
    worst.before_m = std::max(worst.before_m, before.position_m);
    worst.before_rad = std::max(worst.before_rad, before.orientation_rad);
    worst.position_m = std::max(worst.position_m, after.position_m);
    worst.orientation_rad = std::max(worst.orientation_rad, after.orientation_rad);
    worst.worse_m = std::max(worst.worse_m, after.position_m - before.position_m);
    if (std::abs(along) < 1e-3) {
      worst.at_singularity_m = std::max(worst.at_singularity_m, after.position_m);
      worst.at_singularity_rad = std::max(worst.at_singularity_rad, after.orientation_rad);
    }
  }
}

/// Eight paths of 20,000 steps of 20 urad through singular poses: four straight across, along the joint that
/// is singular, and four in a random direction of all joints.
Passage through(const arms::Arm& arm, Singularity kind, double scale) {
  arms::Random random(31 + static_cast<std::uint64_t>(kind));
  const auto model = arms::prepared(arm.robot, arms::table1(arm, scale));
  const auto context = flexcomp::default_context<double>(arm.robot);
  const arms::NominalJacobian jacobian(arm.robot);
  Passage worst;
  for (int path = 0; path < 8; ++path) {
    const Joints middle = singular_pose(arm.robot, jacobian, kind, random);
    Joints direction{};
    if (path % 2 == 0) {
      direction[kind == wrist ? 4 : kind == elbow ? 2 : 1] = 1;
    } else {
      for (double& d : direction) d = random.around(1);
    }
    pass(model, context, middle, direction, 0.2, 20000 / part, worst);
  }
  std::printf(
      "[ measured ] %s x%g %s: %.1f mm %.1f mrad before; at most %.4f mm %.1f mrad after, at it %.4f mm "
      "%.1f mrad; correction %.3f rad, Lipschitz %.1f\n",
      arm.name, scale, names[kind], 1e3 * worst.before_m, 1e3 * worst.before_rad, 1e3 * worst.position_m,
      1e3 * worst.orientation_rad, 1e3 * worst.at_singularity_m, 1e3 * worst.at_singularity_rad,
      worst.correction_rad, worst.lipschitz);
  EXPECT_EQ(worst.refused, 0);
  EXPECT_TRUE(worst.within_limits);
  EXPECT_LE(worst.correction_rad, largest_correction_rad * (1 + 1e-12));
  return worst;
}

TEST(Singularity, KeepsThePosition) {
  struct Bounds {
    Singularity kind;
    double position_m, orientation_rad, lipschitz;
  };
  // At the wrist 10 um of 3 to 14 mm, and the orientation that the arm cannot turn there. A stretched arm (elbow) reaches
  // farther only by its wrist: orientation is what it pays with. Where the wrist is stretched too, the position itself is
  // damped and part of it stays.
  for (const Bounds& most : {Bounds{wrist, 10e-6, 5e-3, 10}, Bounds{elbow, 1.5e-3, 50e-3, 60},
                             Bounds{shoulder, 1.5e-3, 20e-3, 100}}) {
    for (const arms::Arm& arm : arms::all()) {
      SCOPED_TRACE(std::string(arm.name) + " " + names[most.kind]);
      const Passage p = through(arm, most.kind, 1);
      EXPECT_LE(p.position_m, most.position_m);
      EXPECT_LE(p.orientation_rad, most.orientation_rad);
      EXPECT_LE(p.worse_m, 0);
      EXPECT_LE(p.lipschitz, most.lipschitz);
    }
  }
}

TEST(Singularity, TenTimesTheErrorsStaysBoundedAndNoWorse) {
  // 40 to 140 mm of error are beyond what the settings are made for (20 mm): corrections are cut off at
  // 0.1 rad, but the arm never goes worse than it would have gone, and never jumps.
  for (const arms::Arm& arm : arms::all()) {
    for (const Singularity kind : {wrist, elbow, shoulder}) {
      const Passage p = through(arm, kind, 10);
      EXPECT_LE(p.worse_m, 0) << arm.name << " " << names[kind];
      EXPECT_LE(p.lipschitz, 1000) << arm.name << " " << names[kind];
    }
  }
}

TEST(Singularity, AlongIt) {
  // Staying inside the singularity while the others move: nothing may build up or flutter.
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(41);
    const auto model = arms::prepared(arm.robot, arms::table1(arm));
    const auto context = flexcomp::default_context<double>(arm.robot);
    Passage worst;
    for (int path = 0; path < 4; ++path) {
      Joints middle = random.pose(arm.robot);
      for (double& v : middle) v *= 0.7;
      middle[4] = path < 2 ? 0 : 1e-4;
      Joints direction{};
      for (double& d : direction) d = random.around(1);
      direction[4] = 0;
      pass(model, context, middle, direction, 0.2, 20000 / part, worst);
    }
    std::printf("[ measured ] %s, inside the wrist's singularity: %.4f mm %.1f mrad, Lipschitz %.1f\n",
                arm.name, 1e3 * worst.position_m, 1e3 * worst.orientation_rad, worst.lipschitz);
    EXPECT_LE(worst.lipschitz, 60) << arm.name;
    EXPECT_LE(worst.position_m, 1.5e-3) << arm.name;
  }
}

// --- anywhere ---------------------------------------------------------------------------------------------

TEST(Compensation, StatusTellsTheTruthAtAnyPose) {
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(51);
    const auto model = arms::prepared(arm.robot, arms::table1(arm));
    const auto context = flexcomp::default_context<double>(arm.robot);
    int counts[6] = {};
    double ok_m = 0;
    double ok_rad = 0;
    double singular_m = 0;
    double worse_m = 0;
    int worse = 0;
    constexpr int poses = 200000 / part;
    for (int n = 0; n < poses; ++n) {
      const Joints q = random.pose(arm.robot);
      const Compensated<double, 6> out = flexcomp::compensate(model, q, context);
      ++counts[static_cast<int>(out.status)];
      ASSERT_TRUE(within_limits(model, out.q));
      ASSERT_LE(correction(out.q, q), largest_correction_rad * (1 + 1e-12));
      if (out.status == StepStatus::at_limit) continue;
      const auto after = flexcomp::target_residual(model, out.q, q, context);
      if (out.status == StepStatus::ok) {
        ok_m = std::max(ok_m, after.position_m);
        ok_rad = std::max(ok_rad, after.orientation_rad);
      } else {
        singular_m = std::max(singular_m, after.position_m);
      }
      const double before_m = flexcomp::target_residual(model, q, q, context).position_m;
      if (after.position_m > before_m) {
        ++worse;
        worse_m = std::max(worse_m, after.position_m - before_m);
      }
    }
    std::printf(
        "[ measured ] %s, any pose: ok %d (%.1e m, %.1e rad), near_singular %d and limited %d (%.1e m), "
        "at_limit %d; position worse than before at %d poses, by %.1e m\n",
        arm.name, counts[0], ok_m, ok_rad, counts[1], counts[2], singular_m, counts[3], worse, worse_m);
    EXPECT_EQ(counts[static_cast<int>(StepStatus::refused)], 0);
    EXPECT_LE(ok_m, 50e-6) << arm.name;
    EXPECT_LE(ok_rad, 100e-6) << arm.name;
    EXPECT_LE(singular_m, 4e-3) << arm.name;
    // Where an arm is stretched or folded in all its links at once, even the wrist cannot help the position.
    EXPECT_LE(worse, poses / 1000) << arm.name;
    EXPECT_LE(worse_m, 1e-3) << arm.name;
  }
}

TEST(Compensation, NoTermsMeanNoCorrection) {
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(52);
    const auto model = arms::prepared(arm.robot, arms::TermSet<double>());
    const auto context = flexcomp::default_context<double>(arm.robot);
    for (int n = 0; n < 10000; ++n) {
      const Joints q = random.pose(arm.robot);
      const Compensated<double, 6> out = flexcomp::compensate(model, q, context);
      ASSERT_LE(correction(out.q, q), 1e-13);
    }
  }
}

TEST(Compensation, IsAPureFunction) {
  const arms::Arm& arm = arms::all()[0];
  arms::Random random(53);
  const auto model = arms::prepared(arm.robot, arms::everything(arm, random));
  Joints other = random.pose(arm.robot);
  for (int n = 0; n < 1000; ++n) {
    const Joints q = random.pose(arm.robot);
    const auto context = arms::random_context(arm.robot, random);
    const Compensated<double, 6> first = flexcomp::compensate(model, q, context);
    flexcomp::compensate(model, other, context);
    const Compensated<double, 6> second = flexcomp::compensate(model, q, context);
    ASSERT_EQ(std::memcmp(first.q.data(), second.q.data(), sizeof first.q), 0);
    ASSERT_EQ(first.status, second.status);
    other = q;
  }
}

TEST(Compensation, HoldsAJointExactlyAtItsLimit) {
  const arms::Arm& arm = arms::all()[0];
  arms::Robot free = arm.robot;
  for (flexcomp::JointLimits& l : free.limits) l = arms::limits(-400, 400);
  const auto model = arms::prepared(arm.robot, arms::table1(arm));
  const auto unlimited = arms::prepared(free, arms::table1(arm));
  const auto context = flexcomp::default_context<double>(arm.robot);
  arms::Random random(56);
  int limited = 0;
  for (int n = 0; n < 10000; ++n) {
    Joints q = random.pose(arm.robot);
    const std::size_t joint = random.below(6);
    q[joint] = random.below(2) == 0 ? model.upper(joint) : model.lower(joint);
    const Compensated<double, 6> out = flexcomp::compensate(model, q, context);
    const Compensated<double, 6> wanted = flexcomp::compensate(unlimited, q, context);
    bool passes = false;
    for (std::size_t i = 0; i < 6; ++i) {
      passes = passes || wanted.q[i] < model.lower(i) || wanted.q[i] > model.upper(i);
      ASSERT_EQ(out.q[i], std::min(std::max(wanted.q[i], model.lower(i)), model.upper(i)));
    }
    ASSERT_EQ(out.status == StepStatus::at_limit, passes);
    limited += passes ? 1 : 0;
  }
  EXPECT_GT(limited, 3000);
  EXPECT_LT(limited, 7000);
}

template <class S>
class Refused : public ::testing::Test {};
using Scalars = ::testing::Types<double, float>;
// The empty last argument is for clang, which has none of the extension that the macro relies on.
TYPED_TEST_SUITE(Refused, Scalars, );

TYPED_TEST(Refused, CommandsThatAreNotFiniteOrBeyondALimit) {
  using S = TypeParam;
  const arms::Arm& arm = arms::all()[0];
  const auto model = arms::prepared(arm.robot, arms::as<S>(arms::table1(arm)));
  const auto context = flexcomp::default_context<S>(arm.robot);
  const S infinity = std::numeric_limits<S>::infinity();
  for (std::size_t joint = 0; joint < 6; ++joint) {
    const S beyond = std::nextafter(model.upper(joint), infinity);
    const S below = std::nextafter(model.lower(joint), -infinity);
    for (const S bad : {std::numeric_limits<S>::quiet_NaN(), infinity, -infinity, beyond, below,
                        std::numeric_limits<S>::max(), S(-1e9)}) {
      std::array<S, 6> q{};
      q[joint] = bad;
      const Compensated<S, 6> out = flexcomp::compensate(model, q, context);
      EXPECT_EQ(out.status, StepStatus::refused);
      EXPECT_EQ(std::memcmp(out.q.data(), q.data(), sizeof q), 0) << "passed through to the last bit";
    }
    std::array<S, 6> q{};
    q[joint] = model.upper(joint);
    EXPECT_NE(flexcomp::compensate(model, q, context).status, StepStatus::refused);
  }
}

// Wide limits are not a licence: sines and cosines are only exact so far.
TYPED_TEST(Refused, AnglesThatNoSineReaches) {
  using S = TypeParam;
  const arms::Arm& arm = arms::all()[0];
  arms::Robot robot = arm.robot;
  for (flexcomp::JointLimits& l : robot.limits) l = {-1e12, 1e12};
  const auto model = arms::prepared(robot, arms::as<S>(arms::table1(arm)));
  const auto context = flexcomp::default_context<S>(robot);
  for (const S bad : {std::nextafter(flexcomp::LargestAngle<S>::value(), S(1e9)), S(1e6), S(-1e6), S(9e11)}) {
    std::array<S, 6> q{S(0.3), S(-0.4), S(1.2), S(0.5), S(-0.9), S(0.1)};
    q[2] = bad;
    const Compensated<S, 6> out = flexcomp::compensate(model, q, context);
    EXPECT_EQ(out.status, StepStatus::refused) << bad;
    EXPECT_EQ(std::memcmp(out.q.data(), q.data(), sizeof q), 0) << "passed through to the last bit";
  }
  std::array<S, 6> q{S(0.3), S(-0.4), S(1.2) + S(2 * flexcomp::pi) * S(100), S(0.5), S(-0.9), S(0.1)};
  EXPECT_EQ(flexcomp::compensate(model, q, context).status, StepStatus::ok);
}

TYPED_TEST(Refused, ContextsThatAreNotFinite) {
  using S = TypeParam;
  const arms::Arm& arm = arms::all()[0];
  // A set that reads everything, through tables too: those hold their end values and would hide a NaN.
  arms::TermSet<double> set = arms::table1(arm);
  arms::Random random(54);
  arms::add_usual_tables(set, random);
  for (std::uint16_t table = 3; table < 6; ++table)
    set.add(arms::on_link(2, flexcomp::slot::theta), flexcomp::Basis::grid, 1e-4).table = table;
  const auto model = arms::prepared(arm.robot, arms::as<S>(set));
  const std::array<S, 6> q{S(0.1), S(0.2), S(0.3), S(0.4), S(0.5), S(0.6)};
  ASSERT_EQ(flexcomp::compensate(model, q, flexcomp::default_context<S>(arm.robot)).status, StepStatus::ok);
  const S infinity = std::numeric_limits<S>::infinity();
  for (const S bad : {std::numeric_limits<S>::quiet_NaN(), infinity, -infinity}) {
    for (std::size_t member = 0; member < 21; ++member) {
      flexcomp::Context<S> c = flexcomp::default_context<S>(arm.robot);
      std::vector<S*> members{&c.payload_kg, &c.temperature_c, &c.time_s};
      for (S& v : c.payload_com_m) members.push_back(&v);
      for (S& v : c.force_n) members.push_back(&v);
      for (S& v : c.direction) members.push_back(&v);
      for (S& v : c.relative_speed) members.push_back(&v);
      ASSERT_EQ(members.size(), 21U);
      *members[member] = bad;
      const Compensated<S, 6> out = flexcomp::compensate(model, q, c);
      EXPECT_EQ(out.status, StepStatus::refused) << member;
      EXPECT_EQ(out.q, q);
    }
  }
}

TYPED_TEST(Refused, EffectsBeyondAllBounds) {
  using S = TypeParam;
  const arms::Arm& arm = arms::all()[0];
  const std::array<S, 6> q{S(0.1), S(0.2), S(0.3), S(0.4), S(0.5), S(0.6)};
  for (const double payload_kg : {1e9, 1e30, -1e30}) {
    arms::TermSet<double> set = arms::table1(arm);
    set.add(arms::on_link(3, flexcomp::slot::theta), flexcomp::Basis::load_torque_cubed, 1e-6, 2);
    const auto model = arms::prepared(arm.robot, arms::as<S>(set));
    auto context = flexcomp::default_context<S>(arm.robot);
    context.payload_kg = static_cast<S>(payload_kg);
    const Compensated<S, 6> out = flexcomp::compensate(model, q, context);
    EXPECT_EQ(out.status, StepStatus::refused);
    EXPECT_EQ(out.q, q);
  }
}

// A force at the end of the range bends a link without an end, and the joints that are found for it are ordinary: found by fuzzing.
TYPED_TEST(Refused, AnOverflowThatShowsInWhatIsLeftAlone) {
  using S = TypeParam;
  const arms::Arm& arm = arms::all()[0];
  const std::array<S, 6> q{S(1.1), S(0.2), S(0.3), S(0.4), S(0.5), S(0.6)};
  const S most = std::numeric_limits<S>::max();
  unsigned refused = 0;
  for (const auto basis : {flexcomp::Basis::base_moment_x, flexcomp::Basis::load_moment_x}) {
    for (std::uint8_t slot = 0; slot < 5; ++slot) {
      for (const double coefficient : {4.67e-62, 1e-30, 1e-10}) {
        arms::TermSet<double> set;
        set.add(arms::on_link(2, slot), basis, coefficient, 1);
        const auto model = arms::prepared(arm.robot, arms::as<S>(set));
        auto context = flexcomp::default_context<S>(arm.robot);
        for (std::size_t k = 0; k < 3; ++k) {
          context.force_n = {};
          context.force_n[k] = most;
          const Compensated<S, 6> out = flexcomp::compensate(model, q, context);
          EXPECT_TRUE(flexcomp::is_finite(out.remaining_position_m) &&
                      flexcomp::is_finite(out.remaining_orientation_rad))
              << int(slot) << ", " << coefficient << ", " << k;
          if (out.status != StepStatus::refused) continue;
          ++refused;
          EXPECT_EQ(out.q, q);
        }
      }
    }
  }
  EXPECT_GT(refused, 10U);
}

/// Any bits as a scalar.
template <class S>
S scalar_of(std::uint64_t bits) {
  S v;
  std::memcpy(&v, &bits, sizeof v);
  return v;
}

TYPED_TEST(Refused, AnyBitPatternIsBounded) {
  using S = TypeParam;
  // 1,000,000 calls: commands of random bits, of random bits near the range, and good ones, with contexts of
  // random bits in some members. Whatever comes in: either passed through to the last bit, or finite, within
  // limits and near the command.
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(55);
    arms::TermSet<double> set = arms::everything(arm, random);
    const auto model = arms::prepared(arm.robot, arms::as<S>(set));
    int taken = 0;
    for (int n = 0; n < 333334 / part; ++n) {
      const Joints good = random.pose(arm.robot);
      std::array<S, 6> q;
      const std::uint64_t how = random.bits();
      for (std::size_t i = 0; i < 6; ++i) {
        q[i] = static_cast<S>(good[i]);
        if ((how & 7U) == 0 || ((how & 7U) == 1 && i == how % 6)) q[i] = scalar_of<S>(random.bits());
      }
      const auto usual = arms::random_context(arm.robot, random);
      flexcomp::Context<S> c = flexcomp::default_context<S>(arm.robot);
      c.payload_kg = static_cast<S>(usual.payload_kg);
      S* const members[] = {&c.payload_kg,       &c.temperature_c, &c.time_s,       &c.payload_com_m[1],
                            &c.force_n[0],       &c.force_n[2],    &c.direction[2], &c.relative_speed[4],
                            &c.payload_com_m[2], &c.direction[0]};
      if ((how & 8U) != 0) *members[random.below(10)] = scalar_of<S>(random.bits());
      if ((how & 48U) == 48U)
        for (S* const m : members) *m = scalar_of<S>(random.bits());
      const Compensated<S, 6> out = flexcomp::compensate(model, q, c);
      if (out.status == StepStatus::refused) {
        ASSERT_EQ(std::memcmp(out.q.data(), q.data(), sizeof q), 0);
        continue;
      }
      ++taken;
      ASSERT_TRUE(within_limits(model, out.q));
      ASSERT_LE(correction(out.q, q), S(0.1) + S(8) * std::numeric_limits<S>::epsilon());
      ASSERT_TRUE(flexcomp::is_finite(out.remaining_position_m) &&
                  flexcomp::is_finite(out.remaining_orientation_rad));
    }
    EXPECT_GT(taken, 100000 / part) << arm.name;
    EXPECT_LT(taken, 300000 / part) << arm.name;
  }
}

}  // namespace
