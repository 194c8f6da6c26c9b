// SPDX-License-Identifier: Apache-2.0
#include "model/effects.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "files/calibration_file.hpp"
#include "model/host_model.hpp"
#include "model/paper_model.hpp"
#include "support/moving_arm.hpp"
#include "support/robot_files.hpp"

namespace {

using namespace flexcomp::host;
using namespace flexcomp;
using support::robot;
using testing::ElementsAre;

std::vector<std::string> names(const std::vector<Parameter>& parameters) {
  std::vector<std::string> list;
  for (const Parameter& p : parameters) list.push_back(p.name);
  return list;
}

TEST(PaperModel, Has24GeometricParametersThirtyWithBaseAnd39InAllOnAnyArm) {
  for (const char* arm : {"tx60l", "rx160l", "ur5", "ur10"}) {
    const Nominal nominal = robot(arm).nominal;
    EXPECT_EQ(paper_model(nominal, ModelKind::geometric, false).parameters.size(), 24U) << arm;
    EXPECT_EQ(paper_model(nominal, ModelKind::geometric, true).parameters.size(), 30U) << arm;
    EXPECT_EQ(paper_model(nominal, ModelKind::no_gravity, true).parameters.size(), 36U) << arm;
    EXPECT_EQ(paper_model(nominal, ModelKind::no_stiffness, true).parameters.size(), 33U) << arm;
    EXPECT_EQ(paper_model(nominal, ModelKind::full, true).parameters.size(), 39U) << arm;
    EXPECT_EQ(paper_model(nominal, ModelKind::full, false).parameters.size(), 33U) << arm;
  }
}

TEST(PaperModel, BetaReplacesDWhereTheNextAxisIsParallel) {
  EXPECT_THAT(takes_beta(robot("tx60l").nominal), ElementsAre(false, true, false, false, false, false));
  EXPECT_THAT(takes_beta(robot("rx160l").nominal), ElementsAre(false, true, false, false, false, false));
  EXPECT_THAT(takes_beta(robot("ur5").nominal), ElementsAre(false, true, true, false, false, false));
  const std::vector<std::string> list =
      names(paper_model(robot("tx60l").nominal, ModelKind::full, true).parameters);
  EXPECT_EQ(list[0], "link1.theta_deg");
  EXPECT_THAT(std::vector<std::string>(list.begin() + 4, list.begin() + 8),
              ElementsAre("link2.theta_deg", "link2.a_mm", "link2.alpha_deg", "link2.beta_deg"));
  EXPECT_THAT(
      std::vector<std::string>(list.begin() + 24, list.begin() + 30),
      ElementsAre("base.x_mm", "base.y_mm", "base.z_mm", "base.rx_deg", "base.ry_deg", "base.rz_deg"));
  EXPECT_EQ(list[30], "joint_compliance[joint=1].rad_per_nm");
  EXPECT_THAT(std::vector<std::string>(list.begin() + 36, list.end()),
              ElementsAre("link_gravity.k1_rad", "link_gravity.k2_rad", "link_gravity.k3_rad"));
}

TEST(PaperModel, LeavesGravityOutWhereTheMountingForbidsIt) {
  Nominal wall = robot("tx60l").nominal;
  wall.gravity_m_s2 = {9.8, 0, 0};
  EXPECT_EQ(paper_model(wall, ModelKind::full, true).parameters.size(), 36U);
}

TEST(PaperModel, TheTruthOfTheFileIsTheSameModel) {
  const Robot& tx60l = support::tx60l();
  const Calibration truth = load_calibration(support::data + "tx60l_table1.yaml", tx60l);
  std::vector<std::string> in_file = names(parameters_of(truth.terms, tx60l.nominal));
  std::vector<std::string> in_model = names(paper_model(tx60l.nominal, ModelKind::full, true).parameters);
  EXPECT_EQ(in_file, in_model);
  EXPECT_DOUBLE_EQ(truth.terms.terms[0].coefficient, radians(-0.08));
  EXPECT_DOUBLE_EQ(truth.terms.terms[31].coefficient, 1 / 6.67e4);
}

/// One id of every effect, and growth of one link beside that of all.
std::vector<EffectId> one_of_each() {
  std::vector<EffectId> ids{{.effect = Effect::thermal_growth, .link = 4}};
  for (const EffectDescriptor& d : all_effects()) ids.push_back(d.example);
  return ids;
}

TEST(Catalogue, EveryEffectGoesInAndComesBackByName) {
  const Robot& tx60l = support::tx60l();
  ParametricModel model;
  std::vector<EffectId> ids = one_of_each();
  std::set<Effect> seen;
  for (const EffectId& id : ids) {
    add_effect(model, id, tx60l.nominal);
    seen.insert(id.effect);
  }
  EXPECT_EQ(seen.size(), effect_names().size());
  const std::vector<EffectGroup> groups = effects_of(model.set, tx60l.nominal);
  ASSERT_EQ(groups.size(), ids.size());
  for (std::size_t k = 0; k < ids.size(); ++k) EXPECT_EQ(name(groups[k].id), name(ids[k]));
  EXPECT_EQ(names(parameters_of(model.set, tx60l.nominal)), names(model.parameters));
  EXPECT_NO_THROW(prepare(model.set, tx60l, "test"));
}

TEST(Catalogue, NamesAreTheContracts) {
  EXPECT_EQ(name({.effect = Effect::gear_harmonic, .joint = 3, .order = 1.5}),
            "gear_harmonic[joint=3,order=1.5]");
  EXPECT_EQ(name({.effect = Effect::joint_coupling, .joint = 6, .from = 5}),
            "joint_coupling[joint=6,from=5]");
  EXPECT_EQ(name({.effect = Effect::link_gravity}), "link_gravity");
  EXPECT_EQ(name(descriptor(Effect::unnamed).example), "unnamed[place=link3.theta,of=q2+payload_kg]");
  for (const std::string& n : effect_names()) EXPECT_EQ(effect_name(*effect_of(n)), n);
}

TEST(Catalogue, ThermalGrowthDrivesEveryNominalLengthByOneNumber) {
  const Robot& tx60l = support::tx60l();
  ParametricModel model;
  add_effect(model, EffectId{.effect = Effect::thermal_growth}, tx60l.nominal);
  ASSERT_EQ(model.parameters.size(), 1U);
  EXPECT_EQ(model.parameters[0].terms.size(), 4U);  // a2, d3, d4, d6
  model.parameters[0].set(model.set, 12e-6);
  // Ten kelvin on 450 mm of forearm are 54 micrometres.
  EffectId forearm{.effect = Effect::thermal_growth};
  forearm.link = 4;
  ParametricModel one;
  add_effect(one, forearm, tx60l.nominal);
  one.parameters[0].set(one.set, 12e-6);
  support::MovingArm arm(tx60l, one.set);
  const double cold = arm({}).position.z();
  arm.context.temperature_c += 10;
  EXPECT_NEAR(arm({}).position.z() - cold, 54e-6, 1e-9);
}

TEST(Catalogue, LinkGravityIsSineOfTheAnglesOnTheTx60l) {
  const Robot& tx60l = support::tx60l();
  ParametricModel model;
  add_effect(model, EffectId{.effect = Effect::link_gravity}, tx60l.nominal);
  model.parameters[0].set(model.set, 1e-3);
  const support::MovingArm heavy(tx60l, model.set);
  const support::MovingArm light(tx60l);
  for (const double q2 : {-2.0, -0.5, 0.0, 0.7, 1.9}) {
    std::array<double, 6> q{0.3, q2, -0.4, 0.5, 0.6, 0.7};
    const Pose<double> sagged = heavy(q);
    q[1] += 1e-3 * std::sin(q2);
    EXPECT_LT((sagged.position - light(q).position).norm(), 1e-14);
  }
}

TEST(Catalogue, LinkBendingHasAYTiltOnParallelLinksOnly) {
  const Nominal nominal = robot("tx60l").nominal;
  EffectId id{.effect = Effect::link_bending};
  ParametricModel model;
  for (id.link = 2; id.link <= 3; ++id.link) add_effect(model, id, nominal);
  EXPECT_THAT(names(model.parameters),
              ElementsAre("link_bending[link=2].alpha_rad_per_nm", "link_bending[link=2].beta_rad_per_nm",
                          "link_bending[link=3].alpha_rad_per_nm"));
}

TEST(Catalogue, RefusesIdsThatCannotBe) {
  const Nominal nominal = robot("tx60l").nominal;
  const auto wrong = [&](EffectId id) { EXPECT_THROW(keys(id, nominal), std::invalid_argument) << name(id); };
  wrong({.effect = Effect::joint_compliance, .joint = 7});
  wrong({.effect = Effect::joint_coupling, .joint = 2, .from = 2});
  wrong({.effect = Effect::thermal_growth, .link = 1});  // no length
  wrong({.effect = Effect::gear_harmonic, .joint = 1});
  wrong({.effect = Effect::axis_wobble, .joint = 1, .order = 3});
  wrong({.effect = Effect::joint_curve, .joint = 1, .coefficients = 5});
}

TEST(Catalogue, TermsThatFitNoNameAreRefused) {
  const Nominal nominal = robot("tx60l").nominal;
  ParametricModel model;
  add_effect(model, EffectId{.effect = Effect::backlash, .joint = 2}, nominal);
  TermSet odd = model.set;
  odd.terms[0].place.slot = slot::alpha;
  EXPECT_THROW(effects_of(odd, nominal), std::invalid_argument);
  ParametricModel thermal;
  add_effect(thermal, EffectId{.effect = Effect::thermal_growth}, nominal);
  TermSet uneven = thermal.set;
  uneven.terms[1].coefficient = 1e-6;
  EXPECT_THROW(effects_of(uneven, nominal), std::invalid_argument);
}

}  // namespace
