// SPDX-License-Identifier: Apache-2.0
// Admission: what no arm can mean is refused by the index of a term, and the bounds of what is admitted hold everywhere.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include <flexcomp/admission.hpp>

#include <gtest/gtest.h>

#include "support/random_terms.hpp"

namespace {

using arms::on_base;
using arms::on_link;
using arms::on_tool;
using arms::TermSet;
using flexcomp::AdmissionLimits;
using flexcomp::AdmissionRanges;
using flexcomp::Basis;
using flexcomp::Certificate;
using flexcomp::Covariate;
using flexcomp::Refusal;
namespace slot = flexcomp::slot;

/// The verdict on a set, with the rest of what certify() says.
template <class S>
struct Verdict {
  Refusal refusal = Refusal::none;
  Certificate<S> certificate;
  std::uint32_t detail = 0;
};

template <class S = double>
Verdict<S> verdict_on(const arms::Robot& robot, const TermSet<double>& set) {
  Verdict<S> v;
  auto model = std::make_unique<flexcomp::Model<S>>();
  v.refusal = model->prepare(robot, arms::as<S>(set).list());
  if (v.refusal == Refusal::none)
    v.refusal = flexcomp::certify(*model, AdmissionLimits<S>(), flexcomp::default_ranges<S>(robot),
                                  v.certificate, v.detail);
  return v;
}

/// Table 1 and then one more term: the term's index is that of the last effect.
TermSet<double> paper_set() { return arms::table1(arms::all()[0]); }

std::uint32_t last_effect(const TermSet<double>& set) {
  std::uint32_t n = 0;
  for (const auto& t : set.terms) n += flexcomp::is_constant(t) ? 0U : 1U;
  return n - 1;
}

/// The refusal of a set, which has to name its last term, in both scalars.
Refusal refusal_of_last(const arms::Robot& robot, const TermSet<double>& set) {
  const auto in_double = verdict_on<double>(robot, set);
  const auto in_float = verdict_on<float>(robot, set);
  EXPECT_EQ(in_double.refusal, in_float.refusal);
  EXPECT_EQ(in_double.detail, last_effect(set));
  EXPECT_EQ(in_float.detail, last_effect(set));
  return in_double.refusal;
}

TermSet<double> with_grid(Covariate row, Covariate column, double size) {
  TermSet<double> set = paper_set();
  const std::uint16_t table = set.add_grid({-1, 0, 1}, {-1, 0, 1}, {0, 1, 0, -1, 0, 1, 0, 0, 1});
  set.tables.back().row_covariate = row;
  set.tables.back().column_covariate = column;
  set.add(on_link(2, slot::theta), Basis::grid, size).table = table;
  return set;
}

TEST(Admission, TimeAndSpeedAreRefusedInAnyGuise) {
  const arms::Robot robot = arms::tx60l();
  for (const Basis basis : {Basis::time, Basis::step, Basis::relative_speed}) {
    TermSet<double> set = paper_set();
    set.add(on_link(2, slot::theta), basis, 1e-9);
    EXPECT_EQ(refusal_of_last(robot, set), Refusal::not_allowed_covariate);
  }
  for (const Covariate c : {Covariate::time, Covariate::relative_speed}) {
    EXPECT_EQ(refusal_of_last(robot, with_grid(c, Covariate::joint_position, 1e-4)),
              Refusal::not_allowed_covariate);
    EXPECT_EQ(refusal_of_last(robot, with_grid(Covariate::joint_position, c, 1e-4)),
              Refusal::not_allowed_covariate);
  }
  EXPECT_EQ(verdict_on(robot, with_grid(Covariate::joint_position, Covariate::direction, 1e-4)).refusal,
            Refusal::none);
}

TEST(Admission, ComplianceIsBoundedAlsoWhereNoPayloadIsDeclared) {
  arms::Robot robot = arms::tx60l();
  for (const double payload : {0.0, 1.108}) {
    robot.payload_kg = payload;
    for (const double rad_per_nm : {1.0, 0.01}) {
      TermSet<double> set;
      set.add(on_link(6, slot::theta), Basis::load_torque, rad_per_nm, 5);
      EXPECT_EQ(refusal_of_last(robot, set), Refusal::too_compliant) << rad_per_nm;
    }
    TermSet<double> cubed = paper_set();
    cubed.add(on_link(2, slot::theta), Basis::load_torque_cubed, 1e-3, 1);
    EXPECT_EQ(refusal_of_last(robot, cubed), Refusal::too_compliant);
    TermSet<double> base = paper_set();
    base.add(on_base(slot::rx), Basis::base_moment_x, 0.01, 0, -0.375);
    EXPECT_EQ(refusal_of_last(robot, base), Refusal::too_compliant);
  }
  TermSet<double> curve = paper_set();
  flexcomp::Term<double>& t = curve.add(on_link(3, slot::theta), Basis::curve, 1.0, 2);
  t.factor = flexcomp::Factor::payload;
  curve.terms.back().table = curve.add_curve({0.01, 0.01, 0.01, 0.01, 0.01, 0.01});
  EXPECT_EQ(refusal_of_last(robot, curve), Refusal::too_compliant);
}

TEST(Admission, ThermalGrowthIsThatOfAMetal) {
  const arms::Robot robot = arms::tx60l();
  for (const double per_k : {0.02, 6e-5}) {
    TermSet<double> set = paper_set();
    set.add(on_link(2, slot::a), Basis::thermal, per_k, 0);
    EXPECT_EQ(refusal_of_last(robot, set), Refusal::too_large) << per_k;
  }
  TermSet<double> metal = paper_set();
  for (std::size_t i = 1; i <= 6; ++i) {
    metal.add(on_link(i, slot::a), Basis::thermal, 40e-6);
    metal.add(on_link(i, slot::d), Basis::thermal, 40e-6);
  }
  EXPECT_EQ(verdict_on(robot, metal).refusal, Refusal::none);
}

TEST(Admission, SlopesAreThoseOfAnArm) {
  const arms::Robot robot = arms::tx60l();
  for (const double order : {100.0, 300.0, 5000.0}) {
    for (const Basis basis : {Basis::sine, Basis::cosine}) {
      for (const std::size_t link : {1U, 6U}) {
        TermSet<double> set = paper_set();
        set.add(on_link(link, slot::theta), basis, 0.02, link - 1, order);
        EXPECT_EQ(refusal_of_last(robot, set), Refusal::too_steep) << order;
      }
    }
  }
  TermSet<double> motor;  // 20 seconds of arc at order 200
  motor.add(on_link(6, slot::theta), Basis::sine, 20.0 / 3600 * arms::deg, 5, 200);
  const auto v = verdict_on(robot, motor);
  EXPECT_EQ(v.refusal, Refusal::none);
  EXPECT_NEAR(v.certificate.slope[5], 0.0194, 1e-4);
  TermSet<double> steep = with_grid(Covariate::joint_position, Covariate::joint_position, 0.01);
  for (std::size_t k = 0; k < 6; ++k) steep.values[k] *= 1e-3;  // nodes of both sides 1 mrad apart
  EXPECT_EQ(refusal_of_last(robot, steep), Refusal::too_steep);
}

TEST(Admission, ASpikeBetweenTheProbePosesIsSeen) {
  const arms::Robot robot = arms::tx60l();
  std::vector<double> c(256, 0.0);
  c[100] = 0.03;
  TermSet<double> high = paper_set();
  high.add(on_link(3, slot::theta), Basis::curve, 1.0, 2).table = high.add_curve(c);
  EXPECT_EQ(refusal_of_last(robot, high), Refusal::too_large);
  c[100] = 0.015;
  TermSet<double> narrow = paper_set();
  narrow.add(on_link(3, slot::theta), Basis::curve, 1.0, 2).table = narrow.add_curve(c);
  EXPECT_EQ(refusal_of_last(robot, narrow), Refusal::too_steep);
  // 300 seconds of arc in 128 values, every second one of the other sign.
  TermSet<double> coarse = paper_set();
  std::vector<double> zigzag(128);
  for (std::size_t k = 0; k < zigzag.size(); ++k)
    zigzag[k] = (k % 2 == 0 ? 300.0 : -300.0) / 3600 * arms::deg;
  coarse.add(on_link(1, slot::theta), Basis::curve, 1.0, 0).table = coarse.add_curve(zigzag);
  EXPECT_EQ(verdict_on(robot, coarse).refusal, Refusal::none);
}

TEST(Admission, AStepHasAPrice) {
  const arms::Robot robot = arms::tx60l();
  TermSet<double> set;
  std::vector<double> rows(64), columns(10), values(640, 1e-6);
  for (std::size_t k = 0; k < 64; ++k) rows[k] = -3 + 0.1 * static_cast<double>(k);
  for (std::size_t k = 0; k < 10; ++k) columns[k] = -3 + 0.6 * static_cast<double>(k);
  const std::uint16_t table = set.add_grid(rows, columns, values);
  for (std::size_t k = 0; k < 64; ++k) set.add(on_link(1 + k % 6, slot::theta), Basis::grid, 1).table = table;
  const auto v = verdict_on(robot, set);
  EXPECT_EQ(v.refusal, Refusal::too_costly);
  EXPECT_EQ(v.detail, v.certificate.instructions);
  EXPECT_GT(v.detail, 40000U);
}

TEST(Admission, NamesTheTermThatHasMostOfABound) {
  TermSet<double> set = paper_set();
  const std::uint32_t culprit = last_effect(set) + 1;
  set.add(on_link(4, slot::theta), Basis::sine, 0.012, 3, 1);
  for (int k = 0; k < 10; ++k) set.add(on_link(4, slot::theta), Basis::cosine, 1e-3, 3, k + 1.0);
  const auto v = verdict_on(arms::tx60l(), set);
  EXPECT_EQ(v.refusal, Refusal::too_large);
  EXPECT_EQ(v.detail, culprit);
}

TEST(Admission, OffTheJointsLengthsCountByTheReach) {
  const arms::Robot robot = arms::tx60l();
  TermSet<double> set = paper_set();
  set.add(on_link(2, slot::a), Basis::sine, 0.03, 1, 1);
  EXPECT_EQ(refusal_of_last(robot, set), Refusal::too_large);
  set.terms.back().coefficient = 0.01;  // of 1 m
  EXPECT_EQ(verdict_on(robot, set).refusal, Refusal::none);
  set.add(on_tool(slot::rx), Basis::direction, 2e-3, 1);
  EXPECT_EQ(refusal_of_last(robot, set), Refusal::too_large);
}

// A dither about a node must not throw the arm.
TEST(Admission, AGridMayNotBeSteepOverTheDirection) {
  const arms::Robot robot = arms::tx60l();
  for (const double node : {1e-9, 0.5}) {
    TermSet<double> set = paper_set();
    const std::uint16_t table = set.add_grid({-1, 1}, {0, node}, {0, 9e-4, 0, 9e-4});
    set.tables.back().column_covariate = Covariate::direction;
    set.add(on_link(2, slot::theta), Basis::grid, 1).table = table;
    EXPECT_EQ(refusal_of_last(robot, set), Refusal::too_large) << node;
  }
}

TEST(Admission, AWaveStaysWithinTheRangeOfItsSine) {
  const arms::Robot robot = arms::tx60l();
  TermSet<double> set = paper_set();
  set.add(on_link(3, slot::theta), Basis::sine, 1e-6, 2, 41559);
  EXPECT_EQ(refusal_of_last(robot, set), Refusal::too_steep);
}

// d of parallel axes: the tool stays where it is, and the arm is none.
TEST(Admission, ConstantsThatCancelAreRefused) {
  const arms::Robot robot = arms::tx60l();
  for (const double size : {0.06, 1e12}) {
    TermSet<double> set;
    set.add(on_link(2, slot::d), Basis::one, size);
    set.add(on_link(3, slot::d), Basis::one, -size);
    const auto v = verdict_on(robot, set);
    EXPECT_EQ(v.refusal, Refusal::implausible);
    EXPECT_EQ(v.detail, size < 1 ? 60000U : 0xFFFFFFFFU);
  }
  TermSet<double> turned;
  turned.add({flexcomp::body::base, slot::rz}, Basis::one, 3);
  turned.add(on_link(1, slot::theta), Basis::one, -3);
  EXPECT_EQ(verdict_on(robot, turned).refusal, Refusal::implausible);
}

// What moves links moves the wrist many times over near its singularity.
TEST(Admission, LinksMayNotMoveSteeply) {
  const arms::Robot robot = arms::tx60l();
  TermSet<double> set = paper_set();
  set.add(on_link(4, slot::alpha), Basis::sine, 2e-3, 3, 4);
  EXPECT_EQ(verdict_on(robot, set).refusal, Refusal::none);
  set.terms.back().argument = 50;
  EXPECT_EQ(refusal_of_last(robot, set), Refusal::too_steep);
}

TEST(Admission, AdmitsThePapersSetOnEveryArm) {
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(5);
    TermSet<double> set = arms::table1(arm);
    arms::add_joint_curves(set, random, 500e-6, 18);
    const auto v = verdict_on(arm.robot, set);
    EXPECT_EQ(v.refusal, Refusal::none) << arm.name << " " << v.detail;
    EXPECT_EQ(verdict_on<float>(arm.robot, set).refusal, Refusal::none) << arm.name;
    std::printf("%s: at the tool %.2f mm, %.2f mrad; %.2f mrad/kg, %.3f mrad/N; %u instructions\n", arm.name,
                1e3 * v.certificate.position_m, 1e3 * v.certificate.orientation_rad,
                1e3 * v.certificate.rad_per_kg, 1e3 * v.certificate.rad_per_n, v.certificate.instructions);
  }
}

// --- bounds hold -------------------------------------------------------------------------------------------------

/// A vector within a ball, three times in four at its edge.
std::array<double, 3> in_a_ball(arms::Random& random, double radius) {
  std::array<double, 3> v{random.around(1), random.around(1), random.around(1)};
  const double norm = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  const double scale = (random.below(4) == 0 ? random.uniform(0, 1) : 1) * radius / norm;
  for (double& x : v) x *= scale;
  return v;
}

/// A context within the declared ranges, often at their ends.
flexcomp::Context<double, 6> declared_context(const arms::Robot& robot, const AdmissionRanges<double>& ranges,
                                              arms::Random& random) {
  flexcomp::Context<double, 6> c = flexcomp::default_context<double>(robot);
  c.payload_kg = random.below(2) == 0 ? ranges.payload_kg : random.uniform(0, ranges.payload_kg);
  c.payload_com_m = in_a_ball(random, ranges.com_m);
  c.force_n = in_a_ball(random, ranges.force_n);
  c.temperature_c += random.below(2) == 0 ? ranges.temperature_k : random.around(ranges.temperature_k);
  for (double& v : c.direction) v = static_cast<double>(random.below(3)) - 1;
  return c;
}

/// What effects do at a pose: of each joint, rad, and of all other slots together, lengths by the reach.
std::array<double, 7> effects_at(const flexcomp::Model<double>& model, const arms::Joints& q,
                                 const flexcomp::Context<double, 6>& context, double reach) {
  flexcomp::Workspace<double> ws;
  flexcomp::forward(model, q, context, ws);
  std::array<double, 7> out{};
  for (std::size_t i = 0; i < 6; ++i) {
    out[i] = ws.slots.link[i][slot::theta];
    for (std::size_t s = 1; s < 6; ++s)
      out[6] += std::abs(ws.slots.link[i][s]) / (s == slot::d || s == slot::a ? reach : 1);
  }
  for (std::size_t s = 0; s < 6; ++s)
    out[6] += (std::abs(ws.slots.base[s]) + std::abs(ws.slots.tool[s])) / (s < 3 ? reach : 1);
  return out;
}

/// Ranges of an arm that also presses.
AdmissionRanges<double> wide_ranges(const arms::Robot& robot) {
  AdmissionRanges<double> r = flexcomp::default_ranges<double>(robot);
  r.force_n = 60;
  return r;
}

/// Terms of every kind that may be admitted, made smaller until they are.
TermSet<double> random_admitted(const arms::Arm& arm, arms::Random& random, std::size_t effects,
                                Certificate<double>& certificate) {
  TermSet<double> set = arms::table1(arm, random.uniform(0, 1));
  for (const std::size_t size : {6U, 17U, 64U}) set.add_curve(random.around(1, size));
  for (const Covariate c : {Covariate::payload, Covariate::temperature, Covariate::direction}) {
    set.add_grid({-2, -0.5, 0.25, 1.5}, {-1, 0, 1, 10, 30}, random.around(1, 20));
    set.tables.back().row_joint = static_cast<std::uint8_t>(random.below(6));
    set.tables.back().column_covariate = c;
    set.tables.back().column_joint = static_cast<std::uint8_t>(random.below(6));
  }
  const std::vector<flexcomp::Place> places = arms::all_places();
  while (effects != 0) {
    const flexcomp::Place p = random.below(3) == 0 ? places[random.below(places.size())]
                                                   : arms::on_link(1 + random.below(6), slot::theta);
    const std::vector<flexcomp::Term<double>> list = arms::all_bases(p, random);
    const flexcomp::Term<double>& t = list[random.below(list.size())];
    if (t.basis == Basis::time || t.basis == Basis::step || t.basis == Basis::relative_speed ||
        p.body == flexcomp::body::point)
      continue;
    set.terms.push_back(t);
    --effects;
  }
  for (auto& t : set.terms) {
    if (t.basis != Basis::one) t.coefficient *= random.uniform(0.5, 4);
  }
  AdmissionLimits<double> limits;
  limits.instructions = ~0U;
  for (;;) {
    auto model = std::make_unique<flexcomp::Model<double>>();
    EXPECT_EQ(model->prepare(arm.robot, set.list()), Refusal::none);
    std::uint32_t detail = 0;
    if (flexcomp::certify(*model, limits, wide_ranges(arm.robot), certificate, detail) == Refusal::none)
      return set;
    for (auto& t : set.terms) {
      if (t.basis != Basis::one) t.coefficient *= 0.8;
    }
  }
}

TEST(Admission, BoundsHoldOverAllPosesAndContexts) {
  double tightest[4] = {0, 0, 0, 0}, sum[4] = {0, 0, 0, 0};
  int sets = 0;
  for (const arms::Arm& arm : arms::all()) {
    const AdmissionRanges<double> ranges = wide_ranges(arm.robot);
    arms::Random random(17);
    for (int n = 0; n < 60 / arms::part + 1; ++n) {
      Certificate<double> c;
      const TermSet<double> set = random_admitted(arm, random, 1 + random.below(24), c);
      const auto model = std::make_unique<flexcomp::Model<double>>(arms::prepared(arm.robot, set));
      double share[4] = {0, 0, 0, 0};
      for (int k = 0; k < 300; ++k) {
        const flexcomp::Context<double, 6> context = declared_context(arm.robot, ranges, random);
        const arms::Joints q = random.pose(arm.robot);
        const std::array<double, 7> at = effects_at(*model, q, context, c.reach_m);
        for (std::size_t i = 0; i < 7; ++i) {
          const double bound = i < 6 ? c.deflection_rad[i] : c.off_joint_rad;
          ASSERT_LE(std::abs(at[i]), bound * (1 + 1e-9) + 1e-15)
              << arm.name << " set " << n << " place " << i;
          if (bound > 1e-9) share[0] = std::max(share[0], std::abs(at[i]) / bound);
        }
        const flexcomp::Pose<double> nominal = flexcomp::nominal_forward(*model, q);
        const flexcomp::Pose<double> pose = arms::forward(*model, q, context);
        const double shift = (pose.position - nominal.position).norm();
        const double turn = arms::angle_between(nominal.rotation, pose.rotation);
        ASSERT_LE(shift, c.position_m * (1 + 1e-9)) << arm.name << " set " << n;
        ASSERT_LE(turn, c.orientation_rad * (1 + 1e-9)) << arm.name << " set " << n;
        share[2] = std::max(share[2], shift / c.position_m);
        share[3] = std::max(share[3], turn / c.orientation_rad);
        if (k % 3 != 0) continue;
        std::array<double, 7> slope{};
        constexpr double h = 1e-6;
        for (std::size_t j = 0; j < 6; ++j) {
          arms::Joints to = q;
          to[j] += h;
          const std::array<double, 7> moved = effects_at(*model, to, context, c.reach_m);
          for (std::size_t i = 0; i < 7; ++i) slope[i] += std::abs(moved[i] - at[i]) / h;
        }
        for (std::size_t i = 0; i < 7; ++i) {
          const double bound = i < 6 ? c.slope[i] : c.off_joint_slope;
          ASSERT_LE(slope[i], bound * (1 + 1e-9) + 1e-8) << arm.name << " set " << n << " place " << i;
          if (bound > 1e-6) share[1] = std::max(share[1], slope[i] / bound);
        }
      }
      ++sets;
      for (int k = 0; k < 4; ++k) {
        tightest[k] = std::max(tightest[k], share[k]);
        sum[k] += share[k];
      }
    }
  }
  const char* const names[4] = {"deflection", "slope", "position at the tool", "orientation at the tool"};
  for (int k = 0; k < 4; ++k) {
    std::printf("%s: greatest found / bound: mean %.2f, most %.2f\n", names[k], sum[k] / sets, tightest[k]);
    EXPECT_GT(tightest[k], 0.25) << names[k];
  }
}

TEST(Admission, SensitivitiesHold) {
  for (const arms::Arm& arm : arms::all()) {
    const AdmissionRanges<double> ranges = wide_ranges(arm.robot);
    arms::Random random(23);
    for (int n = 0; n < 40 / arms::part + 1; ++n) {
      Certificate<double> c;
      const TermSet<double> set = random_admitted(arm, random, 1 + random.below(24), c);
      const auto model = std::make_unique<flexcomp::Model<double>>(arms::prepared(arm.robot, set));
      for (int k = 0; k < 60; ++k) {
        const arms::Joints q = random.pose(arm.robot);
        const flexcomp::Context<double, 6> from = declared_context(arm.robot, ranges, random);
        const flexcomp::Context<double, 6> to = declared_context(arm.robot, ranges, random);
        flexcomp::Context<double, 6> changed[4] = {from, from, from, from};
        changed[0].payload_kg = to.payload_kg;
        changed[1].force_n = to.force_n;
        changed[2].payload_com_m = to.payload_com_m;
        changed[3].temperature_c = to.temperature_c;
        const auto distance = [](const std::array<double, 3>& a, const std::array<double, 3>& b) {
          return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
        };
        const double allowed[4] = {c.rad_per_kg * std::abs(to.payload_kg - from.payload_kg),
                                   c.rad_per_n * distance(to.force_n, from.force_n),
                                   c.rad_per_m * distance(to.payload_com_m, from.payload_com_m),
                                   c.rad_per_k * std::abs(to.temperature_c - from.temperature_c)};
        const std::array<double, 7> before = effects_at(*model, q, from, c.reach_m);
        for (int kind = 0; kind < 4; ++kind) {
          const std::array<double, 7> after = effects_at(*model, q, changed[kind], c.reach_m);
          for (std::size_t i = 0; i < 7; ++i)
            ASSERT_LE(std::abs(after[i] - before[i]), allowed[kind] * (1 + 1e-9) + 1e-14)
                << arm.name << " set " << n << " kind " << kind << " place " << i;
        }
      }
    }
  }
}

}  // namespace
