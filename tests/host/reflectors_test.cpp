#include "measurement/reflectors.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "files/robot_file.hpp"
#include "measurement/observation.hpp"
#include "support/text_file.hpp"

namespace {

using namespace flexcomp::host;
using namespace flexcomp;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const RobotFile& tx60l() {
  static const RobotFile robot = load_robot(FLEXCOMP_SOURCE_DIR "/host/robots/tx60l.yaml");
  return robot;
}

class Noise {
 public:
  explicit Noise(std::uint64_t seed) : random_(seed) {}
  double operator()() { return normal_(random_); }
  Eigen::Vector3d vector() { return {(*this)(), (*this)(), (*this)()}; }
  Pose<double> pose() {
    Eigen::Quaterniond q((*this)(), (*this)(), (*this)(), (*this)());
    return {q.normalized().toRotationMatrix(), vector()};
  }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

/// Rows of measured reflectors with their true poses.
struct Measured {
  DataFile data;
  std::vector<Pose<double>> truth;
};

Measured measure(std::size_t rows, std::size_t reflectors, double sigma_m, std::uint64_t seed) {
  Noise noise(seed);
  Measured m;
  m.data.path = "data.csv";
  m.data.kind = MeasurementKind::reflectors;
  m.data.reflectors = reflectors;
  for (std::size_t k = 0; k < rows; ++k) {
    Measurement row;
    row.line = k + 2;
    row.position_sigma_m = sigma_m;
    m.truth.push_back(noise.pose());
    for (std::size_t r = 0; r < reflectors; ++r) {
      row.reflector_m[r] = m.truth.back().rotation * tx60l().reflectors_m[r] + m.truth.back().position +
                           sigma_m * noise.vector();
    }
    m.data.rows.push_back(row);
  }
  return m;
}

Vector6<double> error_of(const Observation& o, const Pose<double>& truth) {
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(o.R * truth.rotation.transpose()));
  Vector6<double> e;
  e << o.p_m - truth.position, turn.angle() * turn.axis();
  return e;
}

TEST(Reflectors, ExactPointsGiveTheExactPose) {
  const Measured m = measure(20, 4, 1e-13, 1);
  const auto observations = observe(m.data, tx60l());
  for (std::size_t k = 0; k < 20; ++k) EXPECT_LT(error_of(observations[k], m.truth[k]).norm(), 1e-11);
}

TEST(Reflectors, WhitenedErrorsHaveUnitCovariance) {
  for (const std::size_t reflectors : {3U, 4U}) {
    const Measured m = measure(20000, reflectors, 35e-6, 2);
    std::vector<std::string> warnings;
    const auto observations = observe(m.data, tx60l(), &warnings);
    Matrix6d covariance = Matrix6d::Zero();
    double chi2 = 0;
    for (std::size_t k = 0; k < observations.size(); ++k) {
      const Vector6<double> w = observations[k].whitening * error_of(observations[k], m.truth[k]);
      covariance += w * w.transpose() / static_cast<double>(observations.size());
      chi2 += observations[k].misfit_chi2 / static_cast<double>(observations.size());
    }
    // The standard error of a variance from 20,000 rows is 1 %.
    EXPECT_LT((covariance - Matrix6d::Identity()).cwiseAbs().maxCoeff(), 0.05) << covariance;
    EXPECT_NEAR(chi2, static_cast<double>(3 * reflectors - 6), 0.1);
    EXPECT_THAT(warnings, IsEmpty());  // 20,000 rows at 1e-6 each
  }
}

TEST(Reflectors, NamesTheReflectorThatMoved) {
  for (const std::size_t reflectors : {3U, 4U}) {
    for (std::size_t moved = 0; moved < reflectors; ++moved) {
      Measured m = measure(30, reflectors, 35e-6, 3 + moved);
      // Along the line to a neighbour: a distance changes, which is what can be seen.
      const Eigen::Vector3d along =
          m.data.rows[12].reflector_m[moved] - m.data.rows[12].reflector_m[(moved + 1) % 3];
      m.data.rows[12].reflector_m[moved] += 0.5e-3 * along.normalized();
      std::vector<std::string> warnings;
      observe(m.data, tx60l(), &warnings);
      ASSERT_EQ(warnings.size(), 1U);
      EXPECT_THAT(warnings[0], HasSubstr("data.csv:14:"));
      if (reflectors == 4) {
        EXPECT_THAT(warnings[0], HasSubstr(std::string("reflector ") + "ABCD"[moved]));
      }
    }
  }
}

TEST(Reflectors, AWrongTemplateIsSaidOnce) {
  const Measured m = measure(30, 4, 35e-6, 4);
  RobotFile other = tx60l();
  other.reflectors_m[3].x() += 1e-3;
  std::vector<std::string> warnings;
  observe(m.data, other, &warnings);
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("either the template or sigma_mm is wrong")));
}

TEST(Reflectors, FrameOfThePaper) {
  // A, B, C of the reference tool: the foot of the perpendicular from B on AC is the origin of Ftool, X from B to it.
  const Pose<double> frame = reflector_frame(std::span(tx60l().reflectors_m).first(3));
  EXPECT_LT(frame.position.norm(), 1e-15);
  EXPECT_LT((frame.rotation.col(0) - Eigen::Vector3d::UnitX()).norm(), 1e-15);
  EXPECT_LT((frame.rotation.col(1) + Eigen::Vector3d::UnitY()).norm(), 1e-15);  // from C to A
  EXPECT_LT((frame.rotation.col(2) + Eigen::Vector3d::UnitZ()).norm(), 1e-15);
}

TEST(Reflectors, AnEstimatedTemplateHasTheShapeOfTheTool) {
  const Measured m = measure(400, 4, 35e-6, 5);
  RobotFile unknown = tx60l();
  unknown.reflectors_m.clear();
  std::vector<std::string> warnings;
  const auto observations = observe(m.data, unknown, &warnings);
  EXPECT_THAT(warnings, IsEmpty());
  // The gauge differs from Ftool by one rigid transform E, the same in every row.
  const Pose<double> e = reflector_frame(std::span(tx60l().reflectors_m).first(3));
  Vector6<double> mean = Vector6<double>::Zero();
  for (std::size_t k = 0; k < observations.size(); ++k) {
    const Vector6<double> error = error_of(observations[k], m.truth[k] * e);
    mean += error / 400;
    EXPECT_LT((observations[k].whitening * error).norm(), 7);
  }
  EXPECT_LT(mean.head<3>().norm(), 1e-5);
  EXPECT_LT(mean.tail<3>().norm(), 1e-4);
}

TEST(Reflectors, RefusesPointsOnOneLine) {
  Measured m = measure(3, 3, 1e-5, 6);
  m.data.rows[1].reflector_m[1] = (m.data.rows[1].reflector_m[0] + m.data.rows[1].reflector_m[2]) / 2;
  support::expect_refused([&] { observe(m.data, tx60l()); }, 3, "ax_mm … cz_mm", {"one line"});
  m = measure(3, 4, 1e-5, 6);
  RobotFile three = tx60l();
  three.reflectors_m.pop_back();
  support::expect_refused([&] { observe(m.data, three); }, 0, "tool.reflectors_mm.d", {"data.csv"});
}

TEST(Reflectors, MisfitProbability) {
  // Tables of the chi-square distribution: 5 % above 7.815 (3) and 12.592 (6), 0.1 % above 16.266 and 22.458.
  EXPECT_NEAR(misfit_probability(7.815, 3), 0.05, 1e-5);
  EXPECT_NEAR(misfit_probability(16.266, 3), 0.001, 1e-6);
  EXPECT_NEAR(misfit_probability(12.592, 6), 0.05, 1e-5);
  EXPECT_NEAR(misfit_probability(22.458, 6), 0.001, 1e-6);
  EXPECT_NEAR(misfit_probability(0, 3), 1, 1e-15);
}

TEST(Observation, PosesAndPositionsAreWeightedByTheirSigma) {
  DataFile data;
  data.kind = MeasurementKind::pose;
  Measurement row;
  row.position_sigma_m = 1e-4;
  row.orientation_sigma_rad = 1e-3;
  data.rows.push_back(row);
  Observation o = observe(data, tx60l())[0];
  EXPECT_TRUE(o.has_orientation);
  EXPECT_DOUBLE_EQ(o.whitening(2, 2), 1e4);
  EXPECT_DOUBLE_EQ(o.whitening(5, 5), 1e3);
  data.kind = MeasurementKind::position;
  o = observe(data, tx60l())[0];
  EXPECT_FALSE(o.has_orientation);
  EXPECT_EQ(o.whitening(5, 5), 0);
  data.kind = MeasurementKind::joints;
  EXPECT_THROW(observe(data, tx60l()), InputError);
}

}  // namespace
