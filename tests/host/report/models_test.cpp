// SPDX-License-Identifier: Apache-2.0
// The comparison of models: rows left out by the hat matrix against fits that really leave them out, and the order in which
// the models of the paper come out.
#include "report/models.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <vector>

#include "support/measuring.hpp"

namespace {

using namespace measuring;

std::map<ModelKind, ModelFit> by_kind(const std::vector<ModelFit>& list) {
  std::map<ModelKind, ModelFit> found;
  for (const ModelFit& m : list) found[m.kind] = m;
  return found;
}

/// A row beside a fit to all others.
struct LeftOut {
  std::size_t identifiable;
  double error_m;
};

LeftOut left_out(const Robot& robot, const std::vector<Observation>& rows, std::size_t k,
                 IdentifyOptions options, ModelKind kind) {
  std::vector<Observation> others = rows;
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
  options.model = kind;
  const Identification r = identify(robot, others, "data", options);
  return {r.identifiable, residuals(r.fit.estimate, robot, {rows[k]}, "data")[0].position_m.norm()};
}

TEST(Models, RowsLeftOutAreThoseOfAFitWithoutThem) {
  const Robot robot = tx60l();
  const std::vector<Observation> rows = measure(robot, truth(), 25, 3, Measuring());
  const IdentifyOptions options =
      plain_least_squares();  // a weight that moves with the row is another question
  const auto models = by_kind(compare_models(robot, rows, "data", options));
  ASSERT_EQ(models.size(), 4U);
  for (const ModelKind kind : {ModelKind::full, ModelKind::no_stiffness}) {
    const ModelFit& m = models.at(kind);
    ASSERT_TRUE(m.left_out.has_value());
    double sum = 0;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const auto [identifiable, error] = left_out(robot, rows, k, options, kind);
      ASSERT_EQ(identifiable, m.parameters);
      EXPECT_NEAR(m.left_out_m[k], error, 0.01 * error + 2e-7) << "row " << k;
      sum += error;
    }
    EXPECT_NEAR(m.left_out->mean_m, sum / static_cast<double>(rows.size()), 0.005 * m.left_out->mean_m);
    EXPECT_GT(m.left_out->mean_m, m.fitted.mean_m) << "a row that was seen is predicted better";
  }
}

TEST(Models, OfPositionsTooAndWithUnknownFrames) {
  const Robot robot = tx60l();
  Measuring how{.pose = false};
  const std::vector<Observation> rows = measure(robot, truth(), 40, 5, how);
  IdentifyOptions options = plain_least_squares();
  options.frames = FrameChoice::fit;
  const auto models = by_kind(compare_models(robot, rows, "data", options));
  ASSERT_TRUE(models.count(ModelKind::geometric));
  const ModelFit& m = models.at(ModelKind::geometric);
  ASSERT_TRUE(m.left_out.has_value());
  for (const std::size_t k : {0U, 11U, 39U}) {
    const double error = left_out(robot, rows, k, options, ModelKind::geometric).error_m;
    EXPECT_NEAR(m.left_out_m[k], error, 0.02 * error + 2e-7) << "row " << k;
  }
}

TEST(Models, TheFullModelIsBestOnAFlexibleArmAndNoBetterOnARigidOne) {
  const Robot robot = tx60l();
  const auto flexible =
      by_kind(compare_models(robot, measure(robot, truth(), 60, 7, Measuring()), "data", {}));
  ASSERT_EQ(flexible.size(), 4U);
  EXPECT_EQ(flexible.at(ModelKind::full).parameters, 36U);
  EXPECT_EQ(flexible.at(ModelKind::geometric).parameters, 28U);
  const double best = flexible.at(ModelKind::full).left_out->mean_m;
  for (const ModelKind kind : {ModelKind::geometric, ModelKind::no_gravity, ModelKind::no_stiffness})
    EXPECT_GT(flexible.at(kind).left_out->mean_m, 1.5 * best);
  // Geometry alone is wrong there: with more parameters the fit is always better, the prediction is not.
  TermSet stiff;
  for (const Term<double>& t : truth().terms) {
    if (t.effect == Effect::geometric) stiff.terms.push_back(t);
  }
  ASSERT_FALSE(stiff.terms.empty());
  const auto rigid = by_kind(compare_models(robot, measure(robot, stiff, 60, 7, Measuring()), "data", {}));
  EXPECT_LE(rigid.at(ModelKind::full).fitted.rms_m, rigid.at(ModelKind::geometric).fitted.rms_m * 1.001);
  EXPECT_GT(rigid.at(ModelKind::full).left_out->mean_m,
            0.98 * rigid.at(ModelKind::geometric).left_out->mean_m);
  EXPECT_LT(rigid.at(ModelKind::geometric).chi2_per_dof, 1.3);
}

TEST(Models, ARowThatAloneMakesAParameterKnownCannotBeLeftOut) {
  const Robot robot = tx60l();
  std::vector<Observation> rows = measure(robot, truth(), 40, 9, Measuring());
  // The load hangs on at one pose only, and gravity turns no joint elsewhere: its compliances are known there alone.
  for (Observation& row : rows) row.context.payload_kg = 0;
  rows[4].context.payload_kg = robot.nominal.payload_kg;
  const auto models = by_kind(compare_models(robot, rows, "data", plain_least_squares()));
  ASSERT_TRUE(models.count(ModelKind::no_gravity));
  EXPECT_FALSE(models.at(ModelKind::no_gravity).left_out.has_value());
  EXPECT_TRUE(models.at(ModelKind::geometric).left_out.has_value());
}

}  // namespace
