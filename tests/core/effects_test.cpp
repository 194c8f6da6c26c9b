// SPDX-License-Identifier: Apache-2.0
// Every effect of docs/effects.md through the core's terms, against plain matrices that share no code with it.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "support/plain_case.hpp"

namespace {

using arms::Joints;
using arms::on_base;
using arms::on_link;
using arms::on_point;
using arms::on_tool;
using flexcomp::Basis;
using flexcomp::Model;
namespace slot = flexcomp::slot;

/// Room for more than a controller holds: every effect at once.
using Wide = Model<double, 6, flexcomp::Capacity<256, 16, 2048>>;

/// Effects by name to terms: the table of docs/effects.md.
arms::TermSet<double> terms_of(const plain::Truth& t, const plain::Nominal& nominal) {
  arms::TermSet<double> set;
  const auto index = [](int joint) { return static_cast<std::size_t>(joint - 1); };
  const auto place = [](int link, std::uint8_t s) { return on_link(static_cast<std::size_t>(link), s); };
  for (int i = 1; i <= 6; ++i) {
    const plain::Link& g = t.geometric[index(i)];
    set.add(place(i, slot::theta), Basis::one, g.theta);
    set.add(place(i, slot::d), Basis::one, g.d);
    set.add(place(i, slot::a), Basis::one, g.a);
    set.add(place(i, slot::alpha), Basis::one, g.alpha);
    set.add(place(i, slot::beta), Basis::one, g.beta);
  }
  for (std::uint8_t k = 0; k < 6; ++k) {
    set.add(on_base(k), Basis::one, plain::six(t.base)[k]);
    set.add(on_tool(k), Basis::one, plain::six(t.tool)[k]);
  }
  for (const auto& x : t.joint_compliance)
    set.add(place(x.joint, slot::theta), Basis::load_torque, x.rad_per_nm, index(x.joint));
  for (const auto& x : t.link_gravity) {
    set.add_lever(place(2, slot::theta), x.k1, 1, 2);
    set.add_lever(place(2, slot::theta), x.k2, 2, 4);
    set.add_lever(place(3, slot::theta), x.k3, 2, 4);
  }
  for (const auto& x : t.nonlinear_compliance)
    set.add(place(x.joint, slot::theta), Basis::load_torque_cubed, x.rad_per_nm3, index(x.joint));
  for (const auto& x : t.gear_harmonic) {
    set.add(place(x.joint, slot::theta), Basis::sine, x.sin_rad, index(x.joint), x.order);
    set.add(place(x.joint, slot::theta), Basis::cosine, x.cos_rad, index(x.joint), x.order);
  }
  for (const auto& x : t.joint_curve) {
    set.add(place(x.joint, slot::theta), Basis::curve, 1.0, index(x.joint)).table =
        set.add_curve(x.coefficients);
  }
  for (const auto& x : t.backlash)
    set.add(place(x.joint, slot::theta), Basis::direction, x.half_gap_rad, index(x.joint));
  for (const auto& x : t.readout_lag)
    set.add(place(x.joint, slot::theta), Basis::relative_speed, x.rad, index(x.joint));
  for (const auto& x : t.encoder_scale)
    set.add(place(x.joint, slot::theta), Basis::joint_position, x.gain, index(x.joint));
  for (const auto& x : t.joint_coupling)
    set.add(place(x.joint, slot::theta), Basis::joint_position, x.gain, index(x.from));
  for (const auto& x : t.axis_wobble) {
    set.add(place(x.joint, slot::alpha), Basis::sine, x.alpha_sin, index(x.joint), x.order);
    set.add(place(x.joint, slot::alpha), Basis::cosine, x.alpha_cos, index(x.joint), x.order);
    set.add(place(x.joint, slot::gamma), Basis::sine, x.gamma_sin, index(x.joint), x.order);
    set.add(place(x.joint, slot::gamma), Basis::cosine, x.gamma_cos, index(x.joint), x.order);
  }
  for (const auto& x : t.link_bending) {
    set.add(place(x.link, slot::alpha), Basis::load_moment_x, x.alpha_rad_per_nm, index(x.link));
    set.add(place(x.link, slot::beta), Basis::load_moment_y, x.beta_rad_per_nm, index(x.link));
  }
  for (const auto& x : t.thermal_growth) {
    for (int i = 1; i <= 6; ++i) {
      if (x.link != 0 && x.link != i) continue;
      if (nominal.links[index(i)].a != 0) set.add(place(i, slot::a), Basis::thermal, x.per_k);
      if (nominal.links[index(i)].d != 0) set.add(place(i, slot::d), Basis::thermal, x.per_k);
    }
  }
  for (const auto& x : t.base_drift)
    for (std::uint8_t k = 0; k < 6; ++k) set.add(on_base(k), Basis::time, plain::six(x.per_s)[k]);
  for (const auto& x : t.base_compliance) {
    set.add(on_base(slot::rx), Basis::base_moment_x, x.rx_rad_per_nm, 0, x.pivot_z);
    set.add(on_base(slot::ry), Basis::base_moment_y, x.ry_rad_per_nm, 0, x.pivot_z);
  }
  for (const auto& x : t.payload_error) {
    set.add(arms::on_load(slot::mass), Basis::one, x.mass_kg);
    set.add(arms::on_load(slot::com_x), Basis::one, x.com.x());
    set.add(arms::on_load(slot::com_y), Basis::one, x.com.y());
    set.add(arms::on_load(slot::com_z), Basis::one, x.com.z());
  }
  for (const auto& x : t.reflector_slip)
    for (std::uint8_t k = 0; k < 3; ++k) set.add(on_point(k), Basis::step, x.shift[k], 0, x.after_s);
  for (const auto& x : t.grid) {
    const std::uint16_t table = set.add_grid(x.rows, x.columns, x.values);
    set.tables.back().row_covariate = flexcomp::Covariate::joint_position;
    set.tables.back().row_joint = static_cast<std::uint8_t>(x.row_joint - 1);
    set.tables.back().column_covariate = flexcomp::Covariate::payload;
    set.add(place(x.joint, slot::theta), Basis::grid, 1.0).table = table;
  }
  return set;
}

/// Every effect of the catalogue at once, several times, larger than usual.
plain::Truth everything(arms::Random& random) {
  plain::Truth t;
  const auto small = [&](double size) {
    plain::Small s;
    for (double* v : {&s.x, &s.y, &s.z, &s.rx, &s.ry, &s.rz}) *v = random.around(size);
    return s;
  };
  const auto joint = [&] { return 1 + static_cast<int>(random.below(6)); };
  for (plain::Link& l : t.geometric)
    for (double* v : {&l.theta, &l.d, &l.a, &l.alpha, &l.beta}) *v = random.around(5e-3);
  t.base = small(5e-3);
  t.tool = small(5e-3);
  for (int i = 1; i <= 6; ++i) t.joint_compliance.push_back({i, random.uniform(1e-7, 1e-4)});
  t.link_gravity.push_back({random.around(2e-3), random.around(2e-3), random.around(2e-3)});
  for (int n = 0; n < 2; ++n) {
    t.nonlinear_compliance.push_back({joint(), random.around(5e-7)});
    t.gear_harmonic.push_back(
        {joint(), static_cast<double>(1 + random.below(8)), random.around(3e-4), random.around(3e-4)});
    t.gear_harmonic.push_back({joint(), 100 + random.around(1), random.around(3e-4), random.around(3e-4)});
    const std::vector<double> c = random.around(5e-4, 6 + random.below(60));
    t.joint_curve.push_back({joint(), c});
    t.backlash.push_back({joint(), random.uniform(0, 3e-4)});
    t.readout_lag.push_back({joint(), random.uniform(0, 2e-3)});
    t.encoder_scale.push_back({joint(), random.around(5e-4)});
    t.joint_coupling.push_back({joint(), joint(), random.around(1e-3)});
    t.axis_wobble.push_back({joint(), static_cast<double>(1 + random.below(2)), random.around(3e-4),
                             random.around(3e-4), random.around(3e-4), random.around(3e-4)});
    t.link_bending.push_back({joint(), random.around(1e-5), random.around(1e-5)});
  }
  t.thermal_growth.push_back({0, 12e-6});
  t.thermal_growth.push_back({joint(), random.around(20e-6)});
  t.base_drift.push_back({small(1e-8)});
  t.base_compliance.push_back({random.around(0.5), random.around(1e-6), random.around(1e-6)});
  t.payload_error.push_back(
      {random.around(0.3), plain::Vector(random.around(0.02), random.around(0.02), 0.01)});
  t.reflector_slip.push_back({random.uniform(0, 7200), plain::Vector(1e-4, random.around(1e-3), -2e-4)});
  plain::Grid g{joint(), joint(), {-2.5, -1, 0, 0.3, 2}, {0, 2, 8}, std::vector<double>(15)};
  for (double& v : g.values) v = random.around(5e-4);
  t.grid.push_back(g);
  return t;
}

struct Difference {
  double position_m = 0;
  double rotation = 0;  ///< largest element of the matrices' difference
  double point_m = 0;
};

template <class M>
void compare(const M& model, const plain::Nominal& nominal, const plain::Truth& truth, const Joints& q,
             const flexcomp::Context<double>& context, Difference& most) {
  const plain::Result expected = plain::forward(nominal, truth, q, plain::situation_of(context));
  flexcomp::Workspace<double> ws;
  const flexcomp::Pose<double> pose = flexcomp::forward(model, q, context, ws);
  most.position_m = std::max(most.position_m, (pose.position - plain::origin(expected.pose)).norm());
  most.rotation =
      std::max(most.rotation, (pose.rotation - expected.pose.block<3, 3>(0, 0)).cwiseAbs().maxCoeff());
  most.point_m = std::max(most.point_m, (ws.point - expected.measured_point).norm());
}

TEST(Effects, AllAtOnceAgreeWithPlainMatrices) {
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(61);
    const plain::Nominal nominal = plain::nominal_of(arm.robot);
    Difference most;
    for (int n = 0; n < 300; ++n) {
      const plain::Truth truth = everything(random);
      const auto model = arms::prepared<double, Wide>(arm.robot, terms_of(truth, nominal));
      for (int k = 0; k < 10; ++k)
        compare(model, nominal, truth, random.pose(arm.robot), arms::random_context(arm.robot, random), most);
    }
    std::printf("[ measured ] %s, all effects at once: %.1e m, rotation %.1e, point %.1e m\n", arm.name,
                most.position_m, most.rotation, most.point_m);
    EXPECT_LE(most.position_m, 1e-13) << arm.name;
    EXPECT_LE(most.rotation, 1e-13) << arm.name;
    EXPECT_LE(most.point_m, 1e-18) << arm.name;
  }
}

struct NamedEffect {
  const char* name;
  std::function<void(plain::Truth&, const plain::Truth&)> copy;
};

template <class List>
NamedEffect effect(const char* name, List plain::Truth::*list) {
  return {name, [list](plain::Truth& to, const plain::Truth& from) { to.*list = from.*list; }};
}

TEST(Effects, EachAloneAgreesWithPlainMatrices) {
  using plain::Truth;
  const NamedEffect effects[] = {effect("joint_compliance", &Truth::joint_compliance),
                                 effect("link_gravity", &Truth::link_gravity),
                                 effect("nonlinear_compliance", &Truth::nonlinear_compliance),
                                 effect("gear_harmonic", &Truth::gear_harmonic),
                                 effect("joint_curve", &Truth::joint_curve),
                                 effect("backlash", &Truth::backlash),
                                 effect("readout_lag", &Truth::readout_lag),
                                 effect("encoder_scale", &Truth::encoder_scale),
                                 effect("joint_coupling", &Truth::joint_coupling),
                                 effect("axis_wobble", &Truth::axis_wobble),
                                 effect("link_bending", &Truth::link_bending),
                                 effect("thermal_growth", &Truth::thermal_growth),
                                 effect("base_drift", &Truth::base_drift),
                                 effect("base_compliance", &Truth::base_compliance),
                                 effect("reflector_slip", &Truth::reflector_slip),
                                 effect("grid", &Truth::grid),
                                 effect("payload_error", &Truth::payload_error)};
  // One at a time, so that two faults cannot hide each other; each must also do something.
  for (const arms::Arm& arm : arms::all()) {
    const plain::Nominal nominal = plain::nominal_of(arm.robot);
    for (const NamedEffect& effect : effects) {
      SCOPED_TRACE(std::string(arm.name) + " " + effect.name);
      arms::Random random(62);
      Difference most;
      Difference size;
      for (int n = 0; n < 50; ++n) {
        const Truth all = everything(random);
        Truth without;
        without.geometric = all.geometric;
        // An error of the payload shows where something gives way to it.
        if (std::strcmp(effect.name, "payload_error") == 0) without.joint_compliance = all.joint_compliance;
        Truth one = without;
        effect.copy(one, all);
        const auto model = arms::prepared<double, Wide>(arm.robot, terms_of(one, nominal));
        const Joints q = random.pose(arm.robot);
        const auto context = arms::random_context(arm.robot, random);
        compare(model, nominal, one, q, context, most);
        compare(model, nominal, without, q, context, size);
      }
      EXPECT_LE(most.position_m, 1e-13);
      EXPECT_LE(most.rotation, 1e-13);
      EXPECT_GT(size.position_m + size.rotation + size.point_m, 1e-6);
    }
  }
}

TEST(Effects, GravityInAnyDirection) {
  // Floor, wall, ceiling and a slope: the payload's weight follows the robot file.
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(63);
    Difference most;
    for (int n = 0; n < 200; ++n) {
      arms::Robot robot = arm.robot;
      robot.gravity_m_s2 = {random.around(9.81), random.around(9.81), random.around(9.81)};
      const plain::Nominal nominal = plain::nominal_of(robot);
      plain::Truth truth = everything(random);
      truth.link_gravity.clear();  // refused away from the axis of joint 1
      const auto model = arms::prepared<double, Wide>(robot, terms_of(truth, nominal));
      compare(model, nominal, truth, random.pose(robot), arms::random_context(robot, random), most);
    }
    EXPECT_LE(most.position_m, 1e-13) << arm.name;
  }
}

TEST(Effects, LinkGravityIsRefusedAwayFromTheAxisOfJoint1) {
  flexcomp::Term<double> t;
  t.place = on_link(2, slot::theta);
  t.basis = Basis::link_weight;
  t.joint = 1;
  t.distal_joint = 2;
  for (const std::array<double, 3>& g : {std::array<double, 3>{9.81, 0, 0}, {0, -1e-9, -9.81}}) {
    arms::Robot robot = arms::tx60l();
    robot.gravity_m_s2 = g;
    Model<double> model;
    model.begin(robot);
    EXPECT_EQ(model.add(t), flexcomp::Refusal::mounting);
  }
  arms::Robot ceiling = arms::tx60l();
  ceiling.gravity_m_s2 = {0, -0.0, 9.81};
  Model<double> model;
  model.begin(ceiling);
  EXPECT_EQ(model.add(t), flexcomp::Refusal::none);
}

/// Value of a lever on a robot without errors.
double lever(const arms::Robot& robot, const Joints& q, std::size_t joint, std::size_t distal) {
  arms::TermSet<double> set;
  set.add_lever(on_link(joint + 1, slot::theta), 1.0, joint, distal);
  const auto model = arms::prepared(robot, set);
  const auto context = flexcomp::default_context<double>(robot);
  return flexcomp::basis_value(model, set.terms[0], context, arms::linearised(model, q, context).unloaded);
}

TEST(Effects, LeversOfTheTx60lAreTheSinesOfThePaper) {
  const arms::Robot robot = arms::tx60l();
  arms::Random random(64);
  for (int n = 0; n < 1000; ++n) {
    const Joints q = random.pose(robot);
    ASSERT_NEAR(lever(robot, q, 1, 2), std::sin(q[1]), 1e-14);
    ASSERT_NEAR(lever(robot, q, 2, 4), std::sin(q[1] + q[2]), 1e-14);
  }
}

TEST(Effects, ALeverShorterThanAMillimetreIsZero) {
  // Joint 5 of the TX60L lies on axis 4: no length across it.
  arms::Random random(65);
  const arms::Robot robot = arms::tx60l();
  for (int n = 0; n < 100; ++n) EXPECT_EQ(lever(robot, random.pose(robot), 3, 4), 0);
}

TEST(Effects, PositiveCoefficientsSag) {
  // Every arm stretched out sideways: the tool goes down with k > 0 and with compliance > 0, on the ceiling up.
  arms::TermSet<double> terms;
  terms.add_lever(on_link(2, slot::theta), 1e-3, 1, 2);
  terms.add_lever(on_link(2, slot::theta), 1e-3, 2, 4);
  terms.add_lever(on_link(3, slot::theta), 1e-3, 2, 4);
  terms.add(on_link(2, slot::theta), Basis::load_torque, 1e-5, 1);
  terms.add(on_link(3, slot::theta), Basis::load_torque, 1e-5, 2);
  terms.add(on_link(2, slot::theta), Basis::load_torque_cubed, 1e-7, 1);
  for (const arms::Arm& arm : arms::all()) {
    for (const double gravity : {-9.81, 9.81}) {
      arms::Robot robot = arm.robot;
      robot.gravity_m_s2 = {0, 0, gravity};
      const bool upright = arm.robot.links[1].theta_rad < -1;  // the Staubli's zero is straight up
      for (const double side : {1.0, -1.0}) {
        Joints q{0.4, upright ? side * 1.2 : (side > 0 ? -0.3 : -2.8), 0.2 * side, 0.3, 0.5, 0.1};
        for (std::size_t which = 0; which < terms.terms.size(); ++which) {
          arms::TermSet<double> set;
          set.terms = {terms.terms[which]};
          const auto model = arms::prepared(robot, set);
          const auto context = flexcomp::default_context<double>(robot);
          const double sag = arms::forward(model, q, context).position.z() -
                             flexcomp::nominal_forward(model, q).position.z();
          EXPECT_GT(sag * gravity, 0) << arm.name << " side " << side << " term " << which;
        }
      }
    }
  }
}

TEST(Effects, TorqueIsTheLoadTimesItsLever) {
  // By hand: TX60L stretched out horizontally over +x; 1 kg at the flange centre weighs 9.8 N on 0.92 m.
  arms::Robot robot = arms::tx60l();
  robot.payload_com_m = {0, 0, 0};
  robot.payload_kg = 1;
  arms::TermSet<double> set;
  for (std::size_t i = 0; i < 6; ++i) set.add(on_link(i + 1, slot::theta), Basis::load_torque, 1e-9, i);
  const auto model = arms::prepared(robot, set);
  auto context = flexcomp::default_context<double>(robot);
  const Joints q{0, 90 * arms::deg, 0, 0, 0, 0};
  auto at = arms::linearised(model, q, context);
  const auto torque = [&](std::size_t i) {
    return flexcomp::basis_value(model, set.terms[i], context, at.unloaded);
  };
  EXPECT_NEAR(torque(0), 0, 1e-12);
  EXPECT_NEAR(torque(1), 9.8 * 0.92, 1e-12);
  EXPECT_NEAR(torque(2), 9.8 * 0.52, 1e-12);
  EXPECT_NEAR(torque(4), 9.8 * 0.07, 1e-12);
  // 10 N upwards at the tool, which is at x = 0.92 + 0.06 with its own offset across.
  context.payload_kg = 0;
  context.force_n = {0, 0, 10};
  flexcomp::linearise(model, q, context, at);
  EXPECT_NEAR(torque(1), -10 * 0.98, 1e-12);
}

TEST(Effects, BacklashStaysBehindTheMotion) {
  arms::TermSet<double> set;
  set.add(on_link(1, slot::theta), Basis::direction, 1e-3, 0);
  const arms::Robot robot = arms::tx60l();
  const auto model = arms::prepared(robot, set);
  const Joints q{0.2, 0.9, 0.3, 0, 0.4, 0};
  for (const double direction : {1.0, -1.0, 0.0}) {
    auto context = flexcomp::default_context<double>(robot);
    context.direction[0] = direction;
    Joints behind = q;
    behind[0] -= 1e-3 * direction;
    const auto expected = flexcomp::nominal_forward(model, behind);
    EXPECT_LE((arms::forward(model, q, context).position - expected.position).norm(), 1e-15);
  }
}

TEST(Effects, JointCurveIsThePeriodicSplineOfEffectsMd) {
  arms::Random random(66);
  for (const std::size_t size : {6U, 7U, 18U, 100U, 256U}) {
    const std::vector<double> c = random.around(1, size);
    arms::TermSet<double> set;
    set.add(on_link(1, slot::theta), Basis::curve, 1.0, 0).table = set.add_curve(c);
    const arms::Robot robot = arms::ur10();
    const auto model = arms::prepared(robot, set);
    const auto context = flexcomp::default_context<double>(robot);
    flexcomp::Workspace<double> ws;
    const auto value = [&](double q) {
      ws.q[0] = q;
      return flexcomp::basis_value(model, set.terms[0], context, ws);
    };
    // At random readings of several turns, exactly at knots, just beside them, and at tiny negative ones.
    for (int n = 0; n < 2000; ++n) {
      const double q = random.around(20);
      ASSERT_NEAR(value(q), plain::curve(c, q), 2e-13 * std::max(1.0, static_cast<double>(size) / 10)) << q;
    }
    for (int k = -2 * static_cast<int>(size); k <= 2 * static_cast<int>(size); ++k) {
      const double knot = 2 * flexcomp::pi * k / static_cast<double>(size);
      for (const double q : {knot, std::nextafter(knot, 10), std::nextafter(knot, -10), knot + 1e-12})
        ASSERT_NEAR(value(q), plain::curve(c, q), 1e-12) << k;
    }
    for (const double q : {0.0, -0.0, 1e-300, -1e-300, -1e-20, 5e-324, -5e-324})
      ASSERT_NEAR(value(q), plain::curve(c, 0), 1e-15);
  }
}

TEST(Effects, CurvesTimesAFactor) {
  const arms::Arm& arm = arms::all()[0];
  arms::Random random(67);
  const std::vector<double> c = random.around(1, 12);
  arms::TermSet<double> set;
  const std::uint16_t table = set.add_curve(c);
  using flexcomp::Factor;
  for (const Factor f : {Factor::one, Factor::load_torque, Factor::temperature, Factor::payload}) {
    flexcomp::Term<double>& t = set.add(on_link(3, slot::theta), Basis::curve, 1e-5, 2);
    t.table = table;
    t.factor = f;
  }
  set.add(arms::on_load(slot::mass), Basis::one, 0.25);
  const auto model = arms::prepared(arm.robot, set);
  const plain::Nominal nominal = plain::nominal_of(arm.robot);
  plain::Truth truth;
  truth.payload_error.push_back({0.25, plain::Vector::Zero()});
  for (int n = 0; n < 200; ++n) {
    const Joints q = random.pose(arm.robot);
    const auto context = arms::random_context(arm.robot, random);
    const auto at = arms::linearised(model, q, context);
    const plain::Result plain_arm = plain::forward(nominal, truth, q, plain::situation_of(context));
    // The factor `payload` is the mass that the context names, without payload_error: what a table was
    // measured over is what a controller is told.
    const double factor[4] = {1, plain_arm.torque[2], context.temperature_c - 20, context.payload_kg};
    for (std::size_t k = 0; k < 4; ++k) {
      const double expected = plain::curve(c, q[2]) * factor[k];
      ASSERT_NEAR(flexcomp::basis_value(model, set.terms[k], context, at.unloaded), expected,
                  1e-12 * std::max(1.0, std::abs(factor[k])));
    }
  }
}

TEST(Effects, GridHoldsItsEndsAndMeetsItsNodes) {
  plain::Grid g{1, 2, {-1, 0, 2}, {0, 1, 4, 5}, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 13}};
  arms::TermSet<double> set;
  const std::uint16_t table = set.add_grid(g.rows, g.columns, g.values);
  set.tables.back().row_joint = 1;
  set.tables.back().column_covariate = flexcomp::Covariate::payload;
  set.add(on_link(1, slot::theta), Basis::grid, 1.0).table = table;
  const arms::Robot robot = arms::ur10();
  const auto model = arms::prepared(robot, set);
  auto context = flexcomp::default_context<double>(robot);
  flexcomp::Workspace<double> ws;
  const auto value = [&](double q, double kg) {
    ws.q[1] = q;
    context.payload_kg = kg;
    return flexcomp::basis_value(model, set.terms[0], context, ws);
  };
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 4; ++c) EXPECT_EQ(value(g.rows[r], g.columns[c]), g.values[r * 4 + c]);
  EXPECT_EQ(value(-99, -99), 1);
  EXPECT_EQ(value(99, 99), 13);
  EXPECT_EQ(value(-99, 99), 4);
  EXPECT_EQ(value(1, 4.5), (7 + 8 + 11 + 13) / 4.0);
  arms::Random random(68);
  for (int n = 0; n < 1000; ++n) {
    const double q = random.around(3);
    const double kg = random.uniform(-1, 6);
    ASSERT_NEAR(value(q, kg), plain::bilinear(g, q, kg), 1e-13);
  }
}

TEST(Effects, BaseMomentTurnsAboutItsPivot) {
  // 2 kg at 0.5 m over +x, 0.3 m above F0; a force of 7 N along +x at the tool. About (0, 0, h) the weight
  // turns by m g x whatever h is, the force by F (z - h).
  arms::Robot robot;
  robot.links[0].d_m = 0.3;
  robot.links[0].a_m = 0.5;
  robot.gravity_m_s2 = {0, 0, -9.8};
  robot.payload_kg = 2;
  for (const double pivot : {0.0, -0.375, 1.0}) {
    arms::TermSet<double> set;
    set.add(on_base(slot::ry), Basis::base_moment_y, 1e-6, 0, pivot);
    set.add(on_base(slot::rx), Basis::base_moment_x, 1e-6, 0, pivot);
    const auto model = arms::prepared(robot, set);
    auto context = flexcomp::default_context<double>(robot);
    context.force_n = {7, 0, 0};
    const auto at = arms::linearised(model, Joints{}, context);
    EXPECT_NEAR(flexcomp::basis_value(model, set.terms[0], context, at.unloaded),
                2 * 9.8 * 0.5 + 7 * (0.3 - pivot), 1e-13);
    EXPECT_NEAR(flexcomp::basis_value(model, set.terms[1], context, at.unloaded), 0, 1e-13);
  }
}

TEST(Effects, TorquesAreTakenBeforeAnyEffectBends) {
  // A second compliance must not change the torque that the first one sees: superposition is the contract.
  const arms::Arm& arm = arms::all()[0];
  arms::Random random(69);
  arms::TermSet<double> one;
  one.add(on_link(2, slot::theta), Basis::load_torque, 1e-3, 1);
  arms::TermSet<double> two = one;
  two.add(on_link(4, slot::a), Basis::load_torque, 1e-2, 3);
  two.add(on_link(3, slot::theta), Basis::sine, 0.1, 2, 1.0);
  two.add(on_base(slot::rx), Basis::time, 1e-3);
  const auto first = arms::prepared(arm.robot, one);
  const auto second = arms::prepared(arm.robot, two);
  for (int n = 0; n < 100; ++n) {
    const Joints q = random.pose(arm.robot);
    const auto context = arms::random_context(arm.robot, random);
    flexcomp::Workspace<double> a;
    flexcomp::Workspace<double> b;
    flexcomp::forward(first, q, context, a);
    flexcomp::forward(second, q, context, b);
    ASSERT_EQ(a.slots.link[1][slot::theta], b.slots.link[1][slot::theta]);
  }
}

TEST(Effects, OrderOfTermsDoesNotMatterBeyondRounding) {
  const arms::Arm& arm = arms::all()[1];
  arms::Random random(70);
  const plain::Nominal nominal = plain::nominal_of(arm.robot);
  arms::TermSet<double> set = terms_of(everything(random), nominal);
  const auto forwards = arms::prepared<double, Wide>(arm.robot, set);
  std::reverse(set.terms.begin(), set.terms.end());
  const auto backwards = arms::prepared<double, Wide>(arm.robot, set);
  for (int n = 0; n < 100; ++n) {
    const Joints q = random.pose(arm.robot);
    const auto context = arms::random_context(arm.robot, random);
    const auto a = arms::forward(forwards, q, context);
    const auto b = arms::forward(backwards, q, context);
    ASSERT_LE((a.position - b.position).norm(), 1e-14);
  }
}

TEST(Effects, WhatAModelRefuses) {
  const arms::Robot robot = arms::tx60l();
  const auto refusal = [&](flexcomp::Place place, Basis basis, std::size_t joint = 0, double argument = 0,
                           std::uint16_t table = flexcomp::no_table) {
    Model<double> model;
    model.begin(robot);
    flexcomp::Term<double> t;
    t.place = place;
    t.basis = basis;
    t.joint = static_cast<std::uint8_t>(joint);
    t.argument = argument;
    t.table = table;
    return model.add(t);
  };
  using flexcomp::Refusal;
  for (const flexcomp::Place place : {flexcomp::Place{7, 0},
                                      {1, 6},
                                      {flexcomp::body::base, 6},
                                      {flexcomp::body::tool, 6},
                                      {flexcomp::body::load, 4},
                                      {flexcomp::body::point, 3},
                                      {0x43, 0}}) {
    EXPECT_EQ(refusal(place, Basis::one), Refusal::bad_place) << int{place.body} << " " << int{place.slot};
  }
  EXPECT_EQ(refusal(arms::on_load(slot::mass), Basis::time), Refusal::bad_place);
  EXPECT_EQ(refusal(on_base(slot::x), Basis::thermal), Refusal::bad_place);
  EXPECT_EQ(refusal(on_link(1, slot::theta), Basis::thermal), Refusal::bad_place);
  EXPECT_EQ(refusal(on_link(1, slot::theta), static_cast<Basis>(flexcomp::basis_count)),
            Refusal::unknown_basis);
  EXPECT_EQ(refusal(on_link(1, slot::theta), Basis::load_torque, 6), Refusal::bad_value);
  EXPECT_EQ(refusal(on_link(1, slot::theta), Basis::load_torque, 255), Refusal::bad_value);
  for (const auto& [joint, distal] : {std::pair<std::size_t, std::size_t>{2, 2}, {2, 6}, {5, 0}}) {
    arms::TermSet<double> set;
    set.add_lever(on_link(1, slot::theta), 1.0, joint, distal);
    EXPECT_EQ(Model<double>().prepare(robot, set.list()), Refusal::bad_value);
  }
  EXPECT_EQ(refusal(on_link(1, slot::theta), Basis::curve, 1), Refusal::bad_value);
  EXPECT_EQ(refusal(on_link(1, slot::theta), Basis::grid, 1, 0, 0), Refusal::bad_value);
}

}  // namespace
