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

flexcomp::Context<Jet> as_jets(const flexcomp::Context<double>& from) {
  flexcomp::Context<Jet> c;
  c.payload_kg = Jet(from.payload_kg);
  c.temperature_c = Jet(from.temperature_c);
  c.time_s = Jet(from.time_s);
  for (std::size_t k = 0; k < 3; ++k) {
    c.payload_com_m[k] = Jet(from.payload_com_m[k]);
    c.force_n[k] = Jet(from.force_n[k]);
  }
  for (std::size_t k = 0; k < 6; ++k) {
    c.direction[k] = Jet(from.direction[k]);
    c.relative_speed[k] = Jet(from.relative_speed[k]);
  }
  return c;
}

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
  flexcomp::Refusal prepare(const arms::Robot& robot, const arms::TermSet<double>& set) {
    arms::TermSet<Jet> jets = arms::as<Jet>(set);
    jets.terms.back().coefficient.v[0] = 1;
    return model_.prepare(robot, jets.list());
  }

  /// Derivative for that coefficient; of the measured point where the term is the point's.
  Vector6<double> at(const Joints& q, const flexcomp::Context<double>& context, bool point) const {
    std::array<Jet, 6> joints;
    for (std::size_t i = 0; i < 6; ++i) joints[i] = Jet(q[i]);
    flexcomp::Workspace<Jet> ws;
    const flexcomp::Pose<Jet> pose = flexcomp::forward(model_, joints, as_jets(context), ws);
    if (!point) return derivative(pose);
    Vector6<double> out = Vector6<double>::Zero();
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) out[i] += pose.rotation(i, k).a * ws.point[k].v[0];
    return out;
  }

 private:
  Model<Jet> model_;
};

struct Worst {
  double relative = 0;
  Term<double> term{};
  void take(double r, const Term<double>& t) {
    if (r > relative) {
      relative = r;
      term = t;
    }
  }
};

std::string describe(const Term<double>& t) {
  return "body " + std::to_string(t.place.body) + " slot " + std::to_string(t.place.slot) + " basis " +
         std::to_string(static_cast<int>(t.basis)) + " joint " + std::to_string(t.joint) + " factor " +
         std::to_string(static_cast<int>(t.factor)) + " argument " + std::to_string(t.argument);
}

/// A column of less than this (m/unit and rad/unit of 0.5 mrad's worth) is compared absolutely: it is the
/// rounding of a torque or lever that is zero there.
double floor_of(const Term<double>& t) { return 1e-6 * arms::usual_value(t); }

TEST(ExactColumn, EveryPlaceAndBasisAgreesWithDualNumbers) {
  std::size_t compared = 0;
  std::size_t idle = 0;
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(10);
    Worst constant;
    Worst varying;
    for (const Place place : arms::all_places()) {
      for (const Term<double>& term : arms::all_bases(place, random)) {
        arms::TermSet<double> set = arms::everything(arm, random);
        set.terms.push_back(term);
        Model<double> model;
        ASSERT_EQ(model.prepare(arm.robot, set.list()), flexcomp::Refusal::none) << describe(term);
        DualArm dual;
        ASSERT_EQ(dual.prepare(arm.robot, set), flexcomp::Refusal::none);
        double largest = 0;
        for (int n = 0; n < 6; ++n) {
          const Joints q = random.pose(arm.robot);
          const auto context = arms::random_context(arm.robot, random);
          flexcomp::Linearisation<double> at;
          flexcomp::linearise(model, q, context, at);
          const Vector6<double> expected = dual.at(q, context, place.body == flexcomp::body::point);
          const Vector6<double> got = flexcomp::exact_column(model, at, term, context);
          const double relative = (got - expected).norm() / std::max(expected.norm(), floor_of(term));
          (flexcomp::is_constant(term) ? constant : varying).take(relative, term);
          ASSERT_LE(relative, 1e-9) << arm.name << ", " << describe(term) << "\n"
                                    << got.transpose() << "\n"
                                    << expected.transpose();
          largest = std::max(largest, expected.norm());
          ++compared;
        }
        // Levers of links without a length, or of vertical axes, are zero by definition; so is the growth of a
        // length that is nominally zero.
        const bool may_be_zero = term.basis == Basis::link_weight || term.basis == Basis::thermal;
        if (largest < floor_of(term) && !may_be_zero) ++idle;
      }
    }
    std::printf("[ measured ] %s: exact_column() against Jets, relative: constant %.1e, varying %.1e\n",
                arm.name, constant.relative, varying.relative);
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
  for (const Place place : arms::all_places()) {
    for (Term<double> term : arms::all_bases(place, random)) {
      arms::TermSet<double> set = arms::everything(arm, random);
      set.terms.push_back(term);
      for (Term<double>& t : set.terms) t.coefficient *= 8;
      Model<double> model;
      ASSERT_EQ(model.prepare(arm.robot, set.list()), flexcomp::Refusal::none);
      DualArm dual;
      ASSERT_EQ(dual.prepare(arm.robot, set), flexcomp::Refusal::none);
      const Joints q = random.pose(arm.robot);
      const auto context = arms::random_context(arm.robot, random);
      flexcomp::Linearisation<double> at;
      flexcomp::linearise(model, q, context, at);
      const Vector6<double> expected = dual.at(q, context, place.body == flexcomp::body::point);
      const Vector6<double> got = flexcomp::exact_column(model, at, term, context);
      ASSERT_LE((got - expected).norm(), 1e-9 * std::max(expected.norm(), floor_of(term))) << describe(term);
    }
  }
}

TEST(ExactColumn, CurveCoefficientsAreDualToo) {
  // A host that fits the curve itself puts the variable into the table: same screw, spline weight as basis.
  const arms::Arm& arm = arms::all()[1];
  arms::Random random(12);
  for (int n = 0; n < 200; ++n) {
    arms::TermSet<double> set = arms::table1(arm);
    std::vector<double> c(24);
    for (double& v : c) v = random.around(3e-4);
    const std::uint16_t table = set.add_curve(c);
    set.add(arms::on_link(3, flexcomp::slot::theta), Basis::curve, 1.0, 2).table = table;
    const std::size_t k = random.below(c.size());
    arms::TermSet<Jet> jets = arms::as<Jet>(set);
    jets.values[k].v[0] = 1;
    Model<Jet> dual;
    ASSERT_EQ(dual.prepare(arm.robot, jets.list()), flexcomp::Refusal::none);
    Joints q = random.pose(arm.robot);
    // The spline of c_k reaches two intervals either side of its knot.
    q[2] = 2 * flexcomp::pi / 24 * (static_cast<double>(k) + random.around(2.5));
    const auto context = flexcomp::default_context<double>(arm.robot);
    std::array<Jet, 6> joints;
    for (std::size_t i = 0; i < 6; ++i) joints[i] = Jet(q[i]);
    flexcomp::Workspace<Jet> ws;
    const Vector6<double> expected = derivative(flexcomp::forward(dual, joints, as_jets(context), ws));
    Model<double> model;
    ASSERT_EQ(model.prepare(arm.robot, set.list()), flexcomp::Refusal::none);
    flexcomp::Linearisation<double> at;
    flexcomp::linearise(model, q, context, at);
    const double weight = arms::cardinal_spline(q[2] * 24 / (2 * flexcomp::pi) - static_cast<double>(k));
    const Vector6<double> got = flexcomp::screw(model, at, arms::on_link(3, flexcomp::slot::theta)) * weight;
    ASSERT_LE((got - expected).norm(), 1e-12);
  }
}

TEST(Column, IsExactForConstantTermsWithoutLoadEffects) {
  Worst worst;
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
        Model<double> model;
        ASSERT_EQ(model.prepare(arm.robot, set.list()), flexcomp::Refusal::none);
        DualArm dual;
        ASSERT_EQ(dual.prepare(arm.robot, set), flexcomp::Refusal::none);
        for (int n = 0; n < 5; ++n) {
          const Joints q = random.pose(arm.robot);
          const auto context = arms::random_context(arm.robot, random);
          flexcomp::Linearisation<double> at;
          flexcomp::linearise(model, q, context, at);
          const Vector6<double> expected = dual.at(q, context, place.body == flexcomp::body::point);
          const Vector6<double> got = flexcomp::column(model, at, term, context);
          const double relative = (got - expected).norm() / std::max(expected.norm(), floor_of(term));
          worst.take(relative, term);
          ASSERT_LE(relative, 1e-9) << describe(term);
        }
      }
    }
  }
  std::printf("[ measured ] column() without load effects, relative: %.1e\n", worst.relative);
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
  Model<double> model;
  EXPECT_EQ(model.prepare(arm.robot, set.list()), flexcomp::Refusal::none);
  auto context = flexcomp::default_context<double>(arm.robot);
  context.payload_kg = payload_kg;
  Neglected most;
  for (int n = 0; n < 2000; ++n) {
    const Joints q = random.pose(arm.robot);
    flexcomp::Linearisation<double> at;
    flexcomp::linearise(model, q, context, at);
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
