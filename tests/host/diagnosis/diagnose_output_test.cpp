// SPDX-License-Identifier: Apache-2.0
// What is made of a diagnosis: sentences, JSON, drawings, held-out rows, and what is never pushed. The diagnoses are made
// by hand, so that every word and number has a known source.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "commands/result_text.hpp"
#include "diagnosis/diagnosis_json.hpp"
#include "diagnosis/effect_profile.hpp"
#include "diagnosis/held_out.hpp"
#include "diagnosis/messages.hpp"
#include "identification/validate.hpp"
#include "input_error.hpp"
#include "model/parameter_image.hpp"
#include "report/results.hpp"
#include "support/arms.hpp"
#include "support/measuring.hpp"
#include "support/text_file.hpp"
#include "units.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;
using measuring::truth;
using measuring::tx60l;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double arcsec = flexcomp::host::pi / (180 * 3600);

EffectId of_joint(Effect effect, unsigned joint) { return EffectId{.effect = effect, .joint = joint}; }

/// The paper's arm with one effect more, whose numbers are `values`.
struct Hidden {
  Robot robot = tx60l();
  EffectId id;
  Calibration before, after;
  std::vector<Parameter> parameters;

  Hidden(const EffectId& effect, const std::vector<double>& values) : id(effect) {
    before.terms = truth();
    ParametricModel model;
    model.set = truth();
    add_effect(model, id, robot.nominal);
    for (std::size_t k = 0; k < values.size(); ++k) model.parameters[k].set(model.set, values[k]);
    parameters = model.parameters;
    after.terms = model.set;
  }

  /// Random poses with random directions and speeds, measured with noise N1.
  std::vector<Observation> rows(std::size_t count, std::uint64_t seed, double noise = 1) const {
    const auto model = prepare(after.terms, robot, "truth");
    std::mt19937_64 random(seed);
    arms::Random poses(seed + 1);
    std::uniform_real_distribution<double> symmetric(-1, 1);
    measuring::Measuring how{.noise = noise, .payload_kg = {0, 1.108}};
    std::vector<Observation> list;
    for (std::size_t k = 0; k < count; ++k) {
      Observation row;
      const arms::Joints q = poses.pose(robot.nominal);
      row = measuring::measure(*model, q, k, how, random);
      for (std::size_t j = 0; j < 6; ++j) {
        row.context.relative_speed[j] = symmetric(random);
        row.context.direction[j] = row.context.relative_speed[j] > 0 ? 1 : -1;
      }
      // Once more, for the context that effects look at.
      std::normal_distribution<double> normal;
      Workspace<double, 6> ws;
      const Pose<double> pose = forward(*model, q, row.context, ws);
      for (int i = 0; i < 3; ++i)
        row.p_m[i] = pose.position[i] + noise * measuring::kPosition * normal(random);
      const Eigen::Vector3d turn(normal(random), normal(random), normal(random));
      row.R = rotation_of(noise * measuring::kOrientation * turn) * pose.rotation;
      list.push_back(row);
    }
    return list;
  }

  Diagnosis diagnosis(const std::vector<Observation>& data) const {
    Diagnosis d;
    d.verdict = Verdict::named;
    d.before = before;
    d.after = after;
    FoundEffect e;
    e.id = id;
    for (const Parameter& p : parameters) {
      const std::string key = p.name.substr(p.name.rfind("].") + 2);
      e.coefficients.push_back({key, p.unit, p.get(after.terms), 1e-6 * p.si_per_file_unit()});
    }
    e.p_value = 0.0004;
    e.delta_bic = 123.4;
    e.largest_m = 0.5e-3;
    e.rms_m = 0.2e-3;
    e.pushed = !belongs_to_measurement(id.effect);
    d.effects = {e};
    d.residuals_before = residuals_with(robot, before, data);
    d.residuals_after = residuals_with(robot, after, data);
    d.error_before = statistics(d.residuals_before, data);
    d.error_after = statistics(d.residuals_after, data);
    d.noise_floor_m = noise_floor_m(data);
    d.steps = {{"start", d.error_before.rms_m, 20, 21}, {name(id) + " added", d.error_after.rms_m, 1, 1.1}};
    d.places = {{{3, slot::theta}, 0.8, 0}, {{2, slot::alpha}, 0.3, 0.01}};
    d.places_left = {{{3, slot::theta}, 0.01, 0.6}};
    d.where = Misfit{{3, slot::theta}, 3, {"q3", "payload_kg"}, {0.5 * 60, std::nullopt}, 0.8, 0};
    return d;
  }
};

EffectId harmonic(unsigned joint, double order) {
  return {.effect = Effect::gear_harmonic, .joint = joint, .order = order};
}

/// A function without a name of joint 2 and the payload, which turns joint 3.
EffectId strange(double largest_payload_kg) {
  return {.effect = Effect::unnamed,
          .place = {3, slot::theta},
          .covariate = {Covariate::joint_position, Covariate::payload},
          .covariate_joint = {2, 0},
          .node = {{{-1, 0, 1}, {0, largest_payload_kg}}}};
}

// --- drawings ---------------------------------------------------------------------------------------------------------

/// The line against a formula of its own, and the rows against the line: their scatter is the noise that is claimed.
void judge_profile(const Hidden& hidden, const std::function<double(double)>& expected_rad) {
  const auto rows = hidden.rows(300, 11);
  const auto profile = profile_of(hidden.robot, hidden.after, hidden.id, rows);
  ASSERT_TRUE(profile) << name(hidden.id);
  ASSERT_GE(profile->line.size(), 2U);
  for (const ProfilePoint& p : profile->line)
    EXPECT_NEAR(p.value_rad, expected_rad(p.x), 1e-9) << name(hidden.id) << " at " << p.x;
  double chi2 = 0, left = 0, plain = 0;
  for (const ProfileRow& r : profile->rows) {
    chi2 += std::pow((r.without_rad - expected_rad(r.x)) / r.sigma_rad, 2);
    left += std::pow(r.left_rad / r.sigma_rad, 2);
    plain += std::pow(r.without_rad / r.sigma_rad, 2);
  }
  const auto n = static_cast<double>(profile->rows.size());
  EXPECT_GT(n, 290);
  EXPECT_NEAR(chi2 / n, 1, 0.3) << name(hidden.id);
  EXPECT_NEAR(left / n, 1, 0.3) << name(hidden.id);
  EXPECT_GT(plain / n, 3) << name(hidden.id) << ": the rows do not show it";
}

TEST(EffectProfile, IsTheEffectAndTheRowsLieOnIt) {
  judge_profile(Hidden(harmonic(3, 2), {3e-4, -2e-4}),
                [](double x) { return 3e-4 * std::sin(2 * radians(x)) - 2e-4 * std::cos(2 * radians(x)); });
  const std::vector<double> c{1e-4, -2e-4, 3e-4, -4e-4, 3e-4, -3e-4, 1e-4, 2e-4};
  const EffectId curve{.effect = Effect::joint_curve, .joint = 1, .coefficients = c.size()};
  judge_profile(Hidden(curve, c), [&](double x) { return plain::curve(c, radians(x)); });
  judge_profile(Hidden(of_joint(Effect::encoder_scale, 2), {4e-4}),
                [](double x) { return 4e-4 * radians(x); });
  judge_profile(Hidden({.effect = Effect::joint_coupling, .joint = 6, .from = 5}, {8e-4}),
                [](double x) { return 8e-4 * radians(x); });
  judge_profile(Hidden(of_joint(Effect::backlash, 2), {3e-4}), [](double x) { return -3e-4 * x; });
  judge_profile(Hidden(of_joint(Effect::readout_lag, 1), {1.2e-3}), [](double x) { return 1.2e-3 * x; });
  judge_profile(Hidden(of_joint(Effect::nonlinear_compliance, 5), {1e-3}),
                [](double x) { return 1e-3 * x * x * x; });
}

TEST(EffectProfile, TheBandIsTheCovariance) {
  Hidden hidden(harmonic(3, 1), {3e-4, -2e-4});
  CovarianceFactor covariance;
  covariance.parameters = {"link1.theta_deg", hidden.parameters[1].name,
                           hidden.parameters[0].name};  // any order
  covariance.factor = Eigen::MatrixXd::Zero(3, 3);
  covariance.factor << 1e-3, 0, 0, 2e-6, 5e-6, 0, -1e-6, 3e-6, 4e-6;
  covariance.own = Eigen::Vector3d(1e-4, 3e-6, 2e-6);
  hidden.after.covariance = covariance;
  Eigen::MatrixXd full = covariance.factor * covariance.factor.transpose();
  full.diagonal() += covariance.own.cwiseAbs2();
  const auto profile = profile_of(hidden.robot, hidden.after, hidden.id, hidden.rows(50, 3));
  ASSERT_TRUE(profile);
  // About its mean: a constant turn of the joint is geometry.
  double mean_s = 0, mean_k = 0;
  for (const ProfilePoint& p : profile->line) {
    mean_s += std::sin(radians(p.x)) / static_cast<double>(profile->line.size());
    mean_k += std::cos(radians(p.x)) / static_cast<double>(profile->line.size());
  }
  for (const ProfilePoint& p : profile->line) {
    const double s = std::sin(radians(p.x)) - mean_s, k = std::cos(radians(p.x)) - mean_k;
    const double variance = k * k * full(1, 1) + 2 * s * k * full(1, 2) + s * s * full(2, 2);
    EXPECT_NEAR(p.sigma_rad, std::sqrt(variance), 1e-12);
  }
}

TEST(EffectProfile, OfWhatTurnsNoSingleJointThereIsNone) {
  const Hidden hidden(EffectId{.effect = Effect::thermal_growth}, {1e-5});
  EXPECT_FALSE(profile_of(hidden.robot, hidden.after, hidden.id, hidden.rows(5, 1)));
  const Hidden other(harmonic(3, 1), {1e-4, 0});
  EXPECT_FALSE(profile_of(other.robot, other.before, other.id, other.rows(5, 1))) << "not in the calibration";
}

// --- words ------------------------------------------------------------------------------------------------------------

TEST(DiagnosisWords, SizesInTheUnitOfFilesAndInArcsec) {
  Hidden hidden(harmonic(3, 2), {3 * arcsec, 4 * arcsec});
  Diagnosis d = hidden.diagnosis(hidden.rows(5, 1));
  for (EffectCoefficient& c : d.effects[0].coefficients) c.sigma = 0.5 * arcsec;
  const auto lines = sizes(d.effects[0]);
  ASSERT_EQ(lines.size(), 3U);
  // 3 sin 2q + 4 cos 2q = 5 cos(2q - 36.87 deg): largest at 18.4 deg.
  EXPECT_EQ(lines[0], "amplitude 5 +- 0.5 arcsec, largest at 18 deg and every 180 deg");
  EXPECT_EQ(lines[1], "sin_rad 1.454e-05 +- 2.4e-06  (3 +- 0.5 arcsec)");
  EXPECT_EQ(lines[2], "cos_rad 1.939e-05 +- 2.4e-06  (4 +- 0.5 arcsec)");
  EXPECT_THAT(verdict_sentence(d), HasSubstr("joint 3 has an error that comes twice per turn of the joint"));
}

TEST(DiagnosisWords, ColumnsOfAllJointsAreOneSeries) {
  NotTestable n{Effect::readout_lag, {}};
  for (int j = 1; j <= 6; ++j) n.needs.push_back("move" + std::to_string(j) + "_deg");
  n.needs.emplace_back("time_s");
  EXPECT_EQ(not_testable_text(n), "readout_lag needs move1_deg … move6_deg and time_s");
  EXPECT_EQ(not_testable_text({Effect::backlash, {"dir2", "dir4"}}), "backlash needs dir2 and dir4");
  EXPECT_EQ(not_testable_text({Effect::thermal_growth, {"temp_c"}}), "thermal_growth needs temp_c");
}

TEST(DiagnosisWords, NextStepsFollowTheVerdict) {
  Hidden hidden(of_joint(Effect::readout_lag, 1), {1e-3});
  Diagnosis d = hidden.diagnosis(hidden.rows(5, 1));
  auto text = [&](const std::string& plan) {
    std::string all;
    for (const std::string& s : next_steps(d, "cal2.yaml", plan)) all += s + "\n";
    return all;
  };
  EXPECT_THAT(text(""), HasSubstr("flexcomp push --to BUS cal2.yaml\n"));
  EXPECT_THAT(text(""), HasSubstr("readout_lag[joint=1] belongs to the measurement"));
  EXPECT_THAT(text(""), Not(HasSubstr("--allow-unnamed")));
  d.effects[0].confounded_with = {{of_joint(Effect::backlash, 1), 2.5}};
  EXPECT_THAT(text(""), HasSubstr("no poses were found"));
  d.discriminating_poses.resize(2);
  EXPECT_THAT(text(""), HasSubstr("--plan POSES.csv"));
  EXPECT_THAT(text("p.csv"), HasSubstr("measure the poses of p.csv"));
  // A place that scatters has no term; a smooth function has.
  d.verdict = Verdict::unnamed;
  EXPECT_THAT(text(""), Not(HasSubstr("--allow-unnamed")));
  Diagnosis nothing = d;
  d.after.terms.terms.back().effect = Effect::unnamed;
  EXPECT_THAT(text(""), HasSubstr("--allow-unnamed"));
  // Where nothing was added and the gap stays, the data are looked at before anything is pushed.
  nothing.effects.clear();
  std::swap(d, nothing);
  EXPECT_THAT(text(""), HasSubstr("before anything is pushed"));
  EXPECT_THAT(text(""), Not(HasSubstr("--to BUS")));
  std::swap(d, nothing);
  d.doubts = {"the error did not shrink"};
  EXPECT_THAT(text(""), HasSubstr("cal2.yaml is not to be pushed"));
  EXPECT_THAT(text(""), Not(HasSubstr("--to BUS")));
  EXPECT_THAT(verdict_sentence(d),
              HasSubstr("link3.theta, joint 3 moves wrongly: it follows q3 (around 30 deg) and "
                        "payload_kg; a motion of this place alone explains 80 % of it"));
}

// --- JSON -------------------------------------------------------------------------------------------------------------

TEST(DiagnosisJson, HasTheKeysOfTheContractInUnitsOfFiles) {
  Hidden hidden(harmonic(3, 1), {1e-4, 2e-5});
  const auto rows = hidden.rows(20, 2);
  Diagnosis d = hidden.diagnosis(rows);
  d.effects[0].confounded_with = {{{.effect = Effect::axis_wobble, .joint = 3, .order = 1}, 3.5}};
  d.not_testable = {{Effect::thermal_growth, {"temp_c"}}};
  d.outliers = {4};
  const nlohmann::json j = to_json(d, rows, std::nullopt, hidden.robot);
  EXPECT_EQ(j["verdict"], "named");
  const auto& e = j["effects"][0];
  EXPECT_EQ(e["effect"], "gear_harmonic");
  EXPECT_EQ(e["joint"], 3);
  EXPECT_EQ(e["order"].dump(), "1");
  EXPECT_DOUBLE_EQ(e["coefficients"]["sin_rad"], 1e-4);
  EXPECT_DOUBLE_EQ(e["sigma"]["cos_rad"], 1e-6);
  EXPECT_EQ(e["pushed"], true);
  EXPECT_EQ(e["confounded_with"][0]["effect"], "axis_wobble");
  EXPECT_EQ(e["confounded_with"][0]["joint"], 3);
  EXPECT_DOUBLE_EQ(e["confounded_with"][0]["delta_bic"], 3.5);
  EXPECT_EQ(j["not_testable"][0]["needs"], nlohmann::json({"temp_c"}));
  EXPECT_EQ(j["where"]["place"], "link3.theta");
  EXPECT_EQ(j["where"]["around_deg"].dump(), "[30.0,null]");
  EXPECT_TRUE(j["gap"]["before"]["holdout_rms_mm"].is_null());
  EXPECT_NEAR(j["gap"]["noise_floor_mm"], std::sqrt(3) * 0.035, 1e-12);
  EXPECT_EQ(j["outliers"].dump(), "[6]") << "lines of the file, not indices";
  EXPECT_EQ(j["effects"][0].contains("from"), false);

  d.where.reset();
  d.effects.clear();
  d.verdict = Verdict::none;
  const nlohmann::json none = to_json(d, rows, std::nullopt, hidden.robot);
  EXPECT_TRUE(none["where"].is_null());
  EXPECT_EQ(none["effects"].dump(), "[]");
}

TEST(DiagnosisJson, CurvesAreArraysAndOtherUnitsAreThoseOfFiles) {
  const Hidden hidden({.effect = Effect::joint_curve, .joint = 1, .coefficients = 6},
                      {1e-4, 2e-4, 3e-4, 4e-4, 5e-4, 6e-4});
  const auto rows = hidden.rows(5, 2);
  nlohmann::json j = to_json(hidden.diagnosis(rows), rows, std::nullopt, hidden.robot);
  EXPECT_EQ(j["effects"][0]["coefficients"]["coefficients_rad"].size(), 6U);
  EXPECT_DOUBLE_EQ(j["effects"][0]["coefficients"]["coefficients_rad"][5], 6e-4);
  EXPECT_EQ(j["effects"][0]["sigma"]["coefficients_rad"].size(), 6U);

  const Hidden slipped({.effect = Effect::reflector_slip, .after_s = 3600}, {1e-4, 0, 0});
  j = to_json(slipped.diagnosis(rows), rows, std::nullopt, slipped.robot);
  EXPECT_NEAR(j["effects"][0]["coefficients"]["x_mm"], 0.1, 1e-12);
  EXPECT_EQ(j["effects"][0]["after_s"], 3600);
  EXPECT_EQ(j["effects"][0]["pushed"], false);
}

// --- held-out rows ------------------------------------------------------------------------------------------------------

TEST(HeldOut, IsTheErrorOfThoseRowsAndTouchesNothingElse) {
  const Hidden hidden(harmonic(3, 1), {3e-4, 2e-4});
  const auto rows = hidden.rows(40, 2), others = hidden.rows(30, 3);
  const Diagnosis d = hidden.diagnosis(rows);
  const HeldOut h = held_out(hidden.robot, d, others, "h.csv", false);
  // The same numbers, from the forward model itself.
  const auto judge = [&](const Calibration& set) {
    const auto model = prepare(set.terms, hidden.robot, "");
    double squares = 0, turned = 0;
    for (const Observation& o : others) {
      Workspace<double, 6> ws;
      const Pose<double> pose = forward(*model, o.q_rad, o.context, ws);
      squares += (o.p_m - pose.position).squaredNorm();
      turned += rotation_vector(o.R * pose.rotation.transpose()).squaredNorm();
    }
    const auto n = static_cast<double>(others.size());
    return std::pair{std::sqrt(squares / n), std::sqrt(turned / n)};
  };
  EXPECT_NEAR(h.before.rms_m, judge(d.before).first, 1e-15);
  EXPECT_NEAR(h.after.rms_m, judge(d.after).first, 1e-15);
  EXPECT_NEAR(*h.after.rms_rad, judge(d.after).second, 1e-15);
  EXPECT_LT(h.after.rms_m, 0.5 * h.before.rms_m);
  nlohmann::json with = to_json(d, rows, h, hidden.robot),
                 without = to_json(d, rows, std::nullopt, hidden.robot);
  EXPECT_NE(with, without);
  for (const char* when : {"before", "after"}) {
    for (const char* key : {"holdout_rms_mm", "holdout_rms_deg"}) with["gap"][when][key] = nullptr;
  }
  with["gap"]["holdout_noise_floor_mm"] = nullptr;
  EXPECT_EQ(with, without);
}

TEST(HeldOut, AnotherMeasurementFrameIsRefused) {
  const Hidden hidden(harmonic(3, 1), {3e-4, 2e-4});
  const auto rows = hidden.rows(40, 2);
  auto others = hidden.rows(30, 3);
  for (Observation& o : others) o.p_m.x() += 0.5;
  const Diagnosis d = hidden.diagnosis(rows);
  support::expect_refused([&] { held_out(hidden.robot, d, others, "h.csv", false); }, 0, "x_mm y_mm z_mm",
                          {"h.csv: x_mm y_mm z_mm: expected rows in the same measurement frame"});
  EXPECT_GT(held_out(hidden.robot, d, others, "h.csv", true).before.rms_m, 0.49);
}

TEST(HeldOut, FittedRowsAreRefused) {
  MeasuredData fitted, other;
  fitted.path = "d.csv";
  other.path = "h.csv";
  for (std::size_t k = 0; k < 5; ++k) {
    Measurement m;
    m.line = k + 2;
    m.q_rad[1] = 0.1 * static_cast<double>(k);
    m.position_m.x() = 1 + 0.1 * static_cast<double>(k);
    fitted.rows.push_back(m);
    m.position_m.z() = 1e-6;  // the same pose, measured again: another measurement
    other.rows.push_back(m);
  }
  EXPECT_NO_THROW(refuse_the_fitted(fitted, other));
  other.rows[3].position_m.z() = 0;
  support::expect_refused([&] { refuse_the_fitted(fitted, other); }, 5, "",
                          {"h.csv:5: expected poses that were not fitted", "the measurement of d.csv:5"});
  EXPECT_THROW(refuse_the_fitted(fitted, fitted), InputError);
}

// --- what is never pushed -------------------------------------------------------------------------------------------------

TEST(Push, WhatBelongsToTheMeasurementStaysOut) {
  const Robot robot = tx60l();
  Calibration plain;
  plain.terms = truth();
  Calibration mixed = plain;
  for (const EffectId& id : {EffectId{.effect = Effect::base_drift}, of_joint(Effect::readout_lag, 1),
                             EffectId{.effect = Effect::reflector_slip, .after_s = 60}}) {
    ParametricModel model;
    model.set = mixed.terms;
    add_effect(model, id, robot.nominal);
    for (const Parameter& p : model.parameters) p.set(model.set, 1e-6);
    mixed.terms = model.set;
  }
  EXPECT_EQ(make_image(mixed, robot, 7), make_image(plain, robot, 7)) << "left out, the push goes on";
  EXPECT_EQ(never_pushed(mixed, robot),
            (std::vector<std::string>{"base_drift", "readout_lag[joint=1]", "reflector_slip[after=60]"}));
  EXPECT_TRUE(never_pushed(plain, robot).empty());

  ParametricModel model;
  model.set = mixed.terms;
  add_effect(model, strange(1), robot.nominal);
  mixed.terms = model.set;
  EXPECT_THROW(make_image(mixed, robot, 7), InputError);
  EXPECT_GT(make_image(mixed, robot, 7, {.allow_unnamed = true}).size(), make_image(plain, robot, 7).size());
}

// --- the page -----------------------------------------------------------------------------------------------------------

TEST(DiagnosisPage, ShowsEverythingThatWasAsked) {
  Hidden hidden(harmonic(3, 2), {3e-4, -2e-4});
  CovarianceFactor covariance;
  covariance.parameters = {hidden.parameters[0].name, hidden.parameters[1].name};
  covariance.factor = 1e-5 * Eigen::MatrixXd::Identity(2, 2);
  hidden.after.covariance = covariance;
  const auto rows = hidden.rows(80, 2);
  Diagnosis d = hidden.diagnosis(rows);
  d.not_testable = {{Effect::thermal_growth, {"temp_c"}}};
  d.notes = {"<b>a note & more"};
  d.discriminating_poses = {{{0.1, 0.2, 0.3, 0.4, 0.5, 0.6}, 1.108}};
  const HeldOut others = held_out(hidden.robot, d, hidden.rows(40, 5), "h.csv", false);
  const std::string page = html(page_of(d, rows, hidden.robot, "d.csv", others), false);
  if (const char* keep = std::getenv("FLEXCOMP_KEEP_PAGE")) std::ofstream(keep) << page;
  for (const char* wanted : {"One effect was missing and has a name", "How the gap shrinks", "held-out rows",
                             "link3.theta", "gear_harmonic[joint=3,order=2]", "amplitude", "thermal_growth",
                             "temp_c", "&lt;b&gt;a note &amp; more", "Poses that would tell the rivals apart",
                             "noise", "class=\"bars x\""}) {
    EXPECT_THAT(page, HasSubstr(wanted));
  }
  for (const char* never : {"<script", "<link", "<img", "src=", "url(", "<b>", "nan", ">inf"})
    EXPECT_THAT(page, Not(HasSubstr(never)));

  // An effect without a name, and nothing else.
  const Hidden unnamed(strange(1.108), {0, 1e-4, 0, 0, 2e-4, 0});
  Diagnosis u = unnamed.diagnosis(rows);
  u.effects.clear();
  u.verdict = Verdict::unnamed;
  const std::string other = html(page_of(u, rows, unnamed.robot, "d.csv", std::nullopt), false);
  EXPECT_THAT(other, HasSubstr("no effect of the catalogue explains"));
  EXPECT_THAT(other, HasSubstr("payload_kg = 1.108"));

  // Nothing found, nothing known: the page of a placeholder still stands.
  const std::string empty = html(page_of(Diagnosis(), {}, hidden.robot, "d.csv", std::nullopt), false);
  EXPECT_THAT(empty, HasSubstr("Nothing is missing"));
  EXPECT_THAT(empty, Not(HasSubstr("nan")));
}

}  // namespace
