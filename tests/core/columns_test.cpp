// SPDX-License-Identifier: Apache-2.0
// Identification columns against dual numbers (Ceres' Jets) through the templated forward model.
#include <ceres/jet.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "support/random_terms.hpp"

namespace {

using arms::Joints;
using flexcomp::Basis;
using flexcomp::Model;
using flexcomp::Place;
using flexcomp::Term;
using flexcomp::Vector6;
using Jet = ceres::Jet<double, 1>;

/// Position and orientation part of the derivative: dp, and w of dR = [w] R.
Vector6<double> derivative(const flexcomp::Pose<Jet>& pose) {
  Eigen::Matrix3d r;
  Eigen::Matrix3d dr;
  Vector6<double> out;
  for (int i = 0; i < 3; ++i) {
    out[i] = pose.position[i].v[0];
    for (int j = 0; j < 3; ++j) {
      r(i, j) = pose.rotation(i, j).a;
      dr(i, j) = pose.rotation(i, j).v[0];
    }
  }
  const Eigen::Matrix3d w = dr * r.transpose();
  out.tail<3>() = 0.5 * Eigen::Vector3d(w(2, 1) - w(1, 2), w(0, 2) - w(2, 0), w(1, 0) - w(0, 1));
  return out;
}

/// The Jet model of a set whose last term has its coefficient as the variable.
class DualArm {
 public:
  DualArm(const arms::Robot& robot, const arms::TermSet<double>& set) {
    arms::TermSet<Jet> jets = arms::as<Jet>(set);
    jets.terms.back().coefficient.v[0] = 1;
    model_ = arms::prepared(robot, jets);
  }

  /// Derivative for that coefficient; of the measured point where the term is the point's.
  Vector6<double> at(const Joints& q, const flexcomp::Context<double>& context, bool point) const {
    flexcomp::Workspace<Jet> ws;
    const flexcomp::Pose<Jet> pose = flexcomp::forward(model_, arms::as<Jet>(q), arms::as<Jet>(context), ws);
    if (!point) return derivative(pose);
    Vector6<double> out = Vector6<double>::Zero();
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) out[i] += pose.rotation(i, k).a * ws.point[k].v[0];
    return out;
  }

 private:
  Model<Jet> model_;
};

std::string describe(const Term<double>& t) {
  return "body " + std::to_string(t.place.body) + " slot " + std::to_string(t.place.slot) + " basis " +
         std::to_string(static_cast<int>(t.basis)) + " joint " + std::to_string(t.joint) + " factor " +
         std::to_string(static_cast<int>(t.factor)) + " argument " + std::to_string(t.argument);
}

/// A column of less than this (m/unit and rad/unit of 0.5 mrad's worth) is compared absolutely: it is the
/// rounding of a torque or lever that is zero there.
double floor_of(const Term<double>& t) { return 1e-6 * arms::usual_value(t); }

using ColumnOf = Vector6<double> (*)(const Model<double>&, const flexcomp::Linearisation<double>&,
                                     const Term<double>&, const flexcomp::Context<double, 6>&);

/// Asserts that `column` of the set's last term is the derivative, within 1e-9, at random poses.
/// \return the largest norm of the derivative
double compare_last(const arms::Arm& arm, const arms::TermSet<double>& set, ColumnOf column, int poses,
                    arms::Random& random, double& worst) {
  const Term<double>& term = set.terms.back();
  const auto model = arms::prepared(arm.robot, set);
  const DualArm dual(arm.robot, set);
  double largest = 0;
  for (int n = 0; n < poses; ++n) {
    const Joints q = random.pose(arm.robot);
    const auto context = arms::random_context(arm.robot, random);
    const auto at = arms::linearised(model, q, context);
    const Vector6<double> expected = dual.at(q, context, term.place.body == flexcomp::body::point);
    const Vector6<double> got = column(model, at, term, context);
    const double relative = (got - expected).norm() / std::max(expected.norm(), floor_of(term));
    worst = std::max(worst, relative);
    EXPECT_LE(relative, 1e-9) << arm.name << ", " << describe(term) << "\n"
                              << got.transpose() << "\n"
                              << expected.transpose();
    largest = std::max(largest, expected.norm());
  }
  return largest;
}

TEST(ExactColumn, EveryPlaceAndBasisAgreesWithDualNumbers) {
  std::size_t compared = 0;
  std::size_t idle = 0;
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(10);
    double constant = 0;
    double varying = 0;
    for (const Place place : arms::all_places()) {
      for (const Term<double>& term : arms::all_bases(place, random)) {
        arms::TermSet<double> set = arms::everything(arm, random);
        set.terms.push_back(term);
        constexpr int poses = 6;
        const double largest = compare_last(arm, set, flexcomp::exact_column, poses, random,
                                            flexcomp::is_constant(term) ? constant : varying);
        compared += poses;
        // Levers of links without a length, or of vertical axes, are zero by definition; so is the growth of a
        // length that is nominally zero.
        const bool may_be_zero = term.basis == Basis::link_weight || term.basis == Basis::thermal;
        if (largest < floor_of(term) && !may_be_zero) ++idle;
      }
    }
    std::printf("[ measured ] %s: exact_column() against Jets, relative: constant %.1e, varying %.1e\n",
                arm.name, constant, varying);
  }
  // A basis that is zero wherever the test looks would be no test.
  std::printf("[ measured ] %zu columns, %zu terms idle in all their poses\n", compared, idle);
  EXPECT_LT(idle, compared / 6 / 200);
}

TEST(ExactColumn, HoldsForLargeErrorsToo) {
  // Eight times everything: the derivative is exact, not merely right where errors are small. (Ten times would
  // put a_3 = -1 mm of Table 1 exactly on the 1 mm below which a link-weight lever is zero.)
  const arms::Arm& arm = arms::all()[0];
  arms::Random random(11);
  double worst = 0;
  for (const Place place : arms::all_places()) {
    for (const Term<double>& term : arms::all_bases(place, random)) {
      arms::TermSet<double> set = arms::everything(arm, random);
      set.terms.push_back(term);
      for (Term<double>& t : set.terms) t.coefficient *= 8;
      compare_last(arm, set, flexcomp::exact_column, 1, random, worst);
    }
  }
}

TEST(ExactColumn, CurveCoefficientsAreDualToo) {
  // A host that fits the curve itself puts the variable into the table: same screw, spline weight as basis.
  const arms::Arm& arm = arms::all()[1];
  arms::Random random(12);
  for (int n = 0; n < 200; ++n) {
    arms::TermSet<double> set = arms::table1(arm);
    const std::vector<double> c = random.around(3e-4, 24);
    set.add(arms::on_link(3, flexcomp::slot::theta), Basis::curve, 1.0, 2).table = set.add_curve(c);
    const std::size_t k = random.below(c.size());
    arms::TermSet<Jet> jets = arms::as<Jet>(set);
    jets.values[k].v[0] = 1;
    const Model<Jet> dual = arms::prepared(arm.robot, jets);
    Joints q = random.pose(arm.robot);
    // The spline of c_k reaches two intervals either side of its knot.
    q[2] = 2 * flexcomp::pi / 24 * (static_cast<double>(k) + random.around(2.5));
    const auto context = flexcomp::default_context<double>(arm.robot);
    flexcomp::Workspace<Jet> ws;
    const Vector6<double> expected =
        derivative(flexcomp::forward(dual, arms::as<Jet>(q), arms::as<Jet>(context), ws));
    const auto model = arms::prepared(arm.robot, set);
    const auto at = arms::linearised(model, q, context);
    const double weight = plain::cardinal_spline(q[2] * 24 / (2 * flexcomp::pi) - static_cast<double>(k));
    const Vector6<double> got = flexcomp::screw(model, at, arms::on_link(3, flexcomp::slot::theta)) * weight;
    ASSERT_LE((got - expected).norm(), 1e-12);
  }
}

TEST(Column, IsExactForConstantTermsWithoutLoadEffects) {
  double worst = 0;
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(13);
    for (const Place place : arms::all_places()) {
      if (place.body == flexcomp::body::load) continue;
      for (const Term<double>& term : arms::all_bases(place, random)) {
        if (flexcomp::needs_loads(term.basis, term.factor)) continue;
        arms::TermSet<double> set = arms::table1_geometry(arm);
        arms::add_usual_tables(set, random);
        set.add(arms::on_link(2, flexcomp::slot::theta), Basis::sine, 1e-4, 1, 1.0);
        set.add(arms::on_link(4, flexcomp::slot::gamma), Basis::cosine, 1e-4, 3, 2.0);
        set.terms.push_back(term);
        compare_last(arm, set, flexcomp::column, 5, random, worst);
      }
    }
  }
  std::printf("[ measured ] column() without load effects, relative: %.1e\n", worst);
}

struct Neglected {
  double rotation = 0;         ///< terms that turn: |column - exact| / |exact|, lengths in m
  double shift_position = 0;   ///< terms that shift: m per m
  double shift_rad_per_m = 0;  ///< terms that shift: rad per m
};

/// What H leaves out of the geometric terms of Table 1 over 2,000 poses.
Neglected neglected(const arms::Arm& arm, double payload_kg) {
  arms::Random random(14);
  const arms::TermSet<double> set = arms::table1(arm);
  const auto model = arms::prepared(arm.robot, set);
  auto context = flexcomp::default_context<double>(arm.robot);
  context.payload_kg = payload_kg;
  Neglected most;
  for (int n = 0; n < 2000; ++n) {
    const Joints q = random.pose(arm.robot);
    const auto at = arms::linearised(model, q, context);
    for (const Term<double>& term : set.terms) {
      const Vector6<double> exact = flexcomp::exact_column(model, at, term, context);
      const Vector6<double> off = flexcomp::column(model, at, term, context) - exact;
      if (!flexcomp::is_constant(term)) {
        EXPECT_EQ(off.norm(), 0);  // compliance and gravity come from the same pass in both
      } else if (arms::turns(term.place)) {
        most.rotation = std::max(most.rotation, off.norm() / exact.norm());
      } else {
        most.shift_position = std::max(most.shift_position, off.head<3>().norm());
        most.shift_rad_per_m = std::max(most.shift_rad_per_m, off.tail<3>().norm());
      }
    }
  }
  return most;
}

TEST(Column, SecondOrderThatHNeglects) {
  for (const arms::Arm& arm : arms::all()) {
    for (const double payload_kg : {0.0, 1.108, 5.0, 10.0}) {
      const Neglected n = neglected(arm, payload_kg);
      std::printf(
          "[ measured ] %s, Table 1, %6.3f kg: H neglects %.1e of a rotation's column, %.1e m/m and %.1e "
          "rad/m of a translation's\n",
          arm.name, payload_kg, n.rotation, n.shift_position, n.shift_rad_per_m);
      // Without a load only the levers of the link weight shift (0.7 to 1.5 mrad of sag). With one, a shift of
      // 1 m changes a wrist torque by the payload's whole weight, which the softest joint of Table 1 answers
      // with weight / stiffness = 14 mrad per m at 1.108 kg.
      EXPECT_LE(n.rotation, 4e-3 + 2e-3 * payload_kg) << arm.name;
      EXPECT_LE(n.shift_position, 4e-3 + 2e-3 * payload_kg) << arm.name;
      EXPECT_LE(n.shift_rad_per_m, 4e-3 + 15e-3 * payload_kg) << arm.name;
    }
  }
}

}  // namespace
