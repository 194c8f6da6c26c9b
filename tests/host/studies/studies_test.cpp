// SPDX-License-Identifier: Apache-2.0
// The studies against what is known of them (docs/model.md, sections 8 and 12, and docs/studies.md) and against themselves.
#include "studies/study.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "files/calibration_file.hpp"
#include "model/effects.hpp"
#include "studies/calibrations.hpp"
#include "studies/planned.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;

// Under sanitizers everything is ten times slower: the memory is watched there, the figures are judged without.
#if defined(__SANITIZE_ADDRESS__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif
constexpr std::size_t kRepeats = kSanitized ? 40 : 200;

StudyOptions of(const StudiedArm& arm, const NoiseLevel& noise, std::size_t repeats = kRepeats) {
  StudyOptions options;
  options.arms = {arm};
  options.noises = {noise};
  options.repeats = repeats;
  return options;
}

const StudyRow& row(const Study& study, const std::vector<std::string>& labels) {
  for (const StudyRow& r : study.rows) {
    bool all = true;
    for (const std::string& wanted : labels)
      all = all && std::ranges::find(r.labels, wanted) != r.labels.end();
    if (all) return r;
  }
  ADD_FAILURE() << "no row with " << labels.back();
  return study.rows.front();
}

TEST(Paper, Table1IsTheFileThatTheRestIsTestedWith) {
  const StudiedArm arm = paper_tx60l();
  const Calibration file =
      load_calibration(std::string(FLEXCOMP_SOURCE_DIR) + "/tests/data/tx60l_table1.yaml", arm.robot);
  std::map<std::string, double> want;
  for (const Parameter& p : parameters_of(file.terms, arm.robot.nominal)) want[p.name] = p.get(file.terms);
  const auto have = parameters_of(arm.truth, arm.robot.nominal);
  EXPECT_EQ(have.size(), 39U);
  EXPECT_EQ(want.size(), 39U);
  for (const Parameter& p : have)
    EXPECT_NEAR(p.get(arm.truth), want.at(p.name), 1e-15 + 1e-12 * std::abs(want.at(p.name))) << p.name;
}

TEST(Paper, TheSecondArmMissesByWhatThePaperMeasured) {
  const StudiedArm arm = paper_rx160l();
  EXPECT_NEAR(mean_error_before_m(arm, random_poses(arm, 20000, 99)), 3.72e-3, 0.05e-3);
  EXPECT_EQ(arm.robot.nominal.payload_kg, 6.23);
  for (const Term<double>& t : arm.truth.terms) {
    if (t.effect == Effect::joint_compliance && t.joint == 1) {
      EXPECT_NEAR(1 / t.coefficient, 20 * 6.67e4, 1);
    }
  }
}

// An expected score of normal errors in closed form, against draws.
TEST(Experiment, CramerRaoScoreIsTheScoreOfItsCovariance) {
  const StudiedArm arm = paper_tx60l();
  const Experiment experiment(arm, random_poses(arm, 14, 5), {});
  ASSERT_EQ(experiment.fitted(), 36U);
  const Eigen::MatrixXd factor = experiment.cramer_rao().llt().matrixL();
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  double sum = 0;
  constexpr int draws = 20000;
  for (int k = 0; k < draws; ++k) {
    Eigen::VectorXd z(36);
    for (Eigen::Index i = 0; i < 36; ++i) z[i] = normal(random);
    sum += (1 - (factor * z).array().abs() / experiment.truth().array().abs()).max(0.0).mean() / draws;
  }
  EXPECT_NEAR(experiment.cramer_rao_score(), sum, 0.002);
}

TEST(Experiment, TheSameSeedGivesTheSameScoreOnAnyNumberOfCores) {
  const StudiedArm arm = paper_tx60l();
  const Experiment experiment(arm, random_poses(arm, 14, 5), {});
  const Score a = repeated_score(experiment, 40, 3);
  double sum = 0;
  for (std::uint64_t k = 0; k < 40; ++k)
    sum += experiment.scores(experiment.calibrate((3ULL << 32) + k)).mean() / 40;
  EXPECT_NEAR(a.mean, sum, 1e-12);
  EXPECT_NE(repeated_score(experiment, 40, 4).mean, a.mean);
}

TEST(Experiment, AFailureInOneRepeatIsNotLost) {
  EXPECT_THROW(for_each_repeat(50,
                               [](std::size_t k) {
                                 if (k == 37) throw std::runtime_error("37");
                               }),
               std::runtime_error);
}

TEST(Study, Fig2AnglesMatterMoreAndErrorsGrowWithTheDeviations) {
  const Study study = study_fig2(of(paper_tx60l(), noise_n1));
  const double angles = *row(study, {"joint angles", "1"}).ours;
  const double lengths = *row(study, {"link lengths d", "1"}).ours;
  EXPECT_GT(angles, lengths);
  // Lengths enter linearly, angles nearly.
  EXPECT_NEAR(*row(study, {"link lengths d", "100"}).ours, 100 * lengths, 1e-6);
  EXPECT_NEAR(*row(study, {"joint angles", "10"}).ours, 10 * angles, 0.01 * 10 * angles);
}

TEST(Study, Fig3OnlyTheCompleteModelIsRight) {
  const Study study = study_fig3(of(paper_tx60l(), noise_n1));
  ASSERT_EQ(study.rows.size(), 4U);
  const std::vector<std::string> parameters{"36", "33", "31", "28"};
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(study.rows[k].labels[2], parameters[k]);
    if (k == 0) {
      EXPECT_GT(*study.rows[k].ours, 0.999);
    } else {
      EXPECT_LT(*study.rows[k].ours, 0.9);
    }
  }
}

TEST(Study, Fig4GivesThePapersScoreAndSettledOrientationFails) {
  const Study study = study_fig4(of(paper_tx60l(), noise_n1, 2 * kRepeats));
  const StudyRow& pose = row(study, {"varied", "pose"});
  EXPECT_NEAR(*pose.ours, 0.82, 0.01);
  EXPECT_NEAR(*pose.ours, *pose.limit, 0.01) << "least squares reach the bound of unbiased estimators";
  EXPECT_NEAR(*pose.paper, 0.8218, 1e-9);
  EXPECT_NEAR(*row(study, {"pose, unweighted mm and rad"}).ours, 0.61, 0.02);
  EXPECT_LT(*row(study, {"varied", "position"}).ours, *pose.ours - 0.1);
  EXPECT_EQ(pose.labels.back(), "36 of 36");
  for (const char* model : {"pose", "position"}) {
    const StudyRow& settled = row(study, {"settled", model});
    EXPECT_LT(*settled.ours, *row(study, {"varied", model}).ours - 0.1);
    EXPECT_NE(settled.labels.back(), "36 of 36");
    EXPECT_NE(settled.labels.back(), "35 of 35");
  }
}

// The mean residual of repeated calibrations is what the covariance of the parameters says, within 5 %.
TEST(Study, Table3ReachesTheNoiseLimitedBound) {
  std::vector<StudiedArm> arms{paper_tx60l()};
  if (!kSanitized) arms.push_back(paper_rx160l());
  for (const StudiedArm& arm : arms) {
    const Study study = study_table3(of(arm, noise_n1, 100));
    const StudyRow& before = row(study, {"nominal"});
    EXPECT_NEAR(*before.ours, *before.paper, 0.05);
    for (const char* seen : {"truly", "as measured"}) {
      const StudyRow& after = row(study, {"rigid-flexible, poses", seen});
      std::printf("%s %s: %.4f mm, bound %.4f mm\n", arm.name.c_str(), seen, *after.ours, *after.limit);
      EXPECT_NEAR(*after.ours, *after.limit, 0.05 * *after.limit) << arm.name << " " << seen;
    }
    const StudyRow& after = row(study, {"rigid-flexible, poses", "as measured"});
    EXPECT_LE(*after.ours, *after.paper);
    EXPECT_EQ(row(study, {"kinematic, positions of the flange"}).labels[3], "24");
    EXPECT_EQ(row(study, {"rigid-flexible, positions of the flange"}).labels[3], "31");
    EXPECT_GT(*row(study, {"kinematic, positions of the flange", "truly"}).ours,
              3 * *row(study, {"rigid-flexible, poses", "truly"}).ours);
  }
}

// The rest of fig8 takes minutes (its swarms): by hand, figures in docs/model.md. Here what it stands on.
TEST(Planned, OurPlanRaisesTheLimitToWhatIsKnownOfTheSetUp) {
  const StudiedArm arm = paper_tx60l();
  ExperimentOptions n1;
  ExperimentOptions n2;
  n2.noise = noise_n2;
  const auto plan = planned_poses(arm, 14, Planning::ours, 1);
  EXPECT_NEAR(Experiment(arm, plan, n1).cramer_rao_score(), 0.86, 0.01) << "docs/model.md, section 12";
  EXPECT_NEAR(Experiment(arm, plan, n2).cramer_rao_score(), 0.78, 0.01);
  if (kSanitized) return;
  StudiedArm heavy = arm;
  heavy.robot.nominal.payload_kg = 5;
  const auto loaded = planned_poses(heavy, 14, Planning::ours, 1);
  EXPECT_NEAR(Experiment(heavy, loaded, n1).cramer_rao_score(), 0.91, 0.01);
  EXPECT_NEAR(Experiment(heavy, loaded, n2).cramer_rao_score(), 0.83, 0.01);
  const auto two = planned_poses(arm, 14, Planning::ours, 1, {1.108, 5.54});
  std::set<double> payloads;
  for (const StudiedPose& pose : two) payloads.insert(pose.payload_kg);
  EXPECT_EQ(payloads.size(), 2U) << "the plan uses both";
  EXPECT_GT(Experiment(arm, two, n1).cramer_rao_score(), 0.9);
}

}  // namespace
