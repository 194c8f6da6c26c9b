// SPDX-License-Identifier: Apache-2.0
#include "files/data_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <tuple>

#include "support/robot_files.hpp"
#include "support/text_file.hpp"
#include "units.hpp"

namespace data_files {

using namespace flexcomp::host;
using support::expect_refused;
using support::replaced;
using support::tx60l;
using testing::ElementsAre;
using testing::HasSubstr;

const std::string joints = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg";
const std::string good = joints +
                         ",x_mm,y_mm,z_mm\n"
                         "10,20,30,40,50,60,1,2,3\n"
                         "-10,20,30,40,50,60,4,5,6\n"
                         "10,20,30,40,50,60,1,2,3.1\n";

MeasuredData load(const std::string& text, const LoadOptions& options = {}) {
  return load_data(support::write("data.csv", text), tx60l(), options);
}
TargetsFile targets(const std::string& text) {
  return load_targets(support::write("targets.csv", text), tx60l());
}

void refused(const std::string& text, std::size_t line, const std::string& field,
             const std::vector<std::string>& parts = {}) {
  expect_refused([&] { load(text); }, line, field, parts);
}

TEST(MeasuredData, ReadsPositions) {
  const MeasuredData d = load(good);
  EXPECT_EQ(d.kind, MeasurementKind::position);
  ASSERT_EQ(d.rows.size(), 3U);
  EXPECT_EQ(d.rows[1].line, 3U);
  EXPECT_EQ(d.rows[1].q_rad[0], radians(-10));
  EXPECT_EQ(d.rows[0].position_m, Eigen::Vector3d(0.001, 0.002, 0.003));
  EXPECT_EQ(d.rows[0].context.payload_kg, 1.108);
  EXPECT_EQ(d.rows[0].context.payload_com_m, (std::array<double, 3>{0.005, 0.008, 0.06}));
  EXPECT_EQ(d.rows[0].position_sigma_m, tx60l().position_sigma_m);
  EXPECT_TRUE(d.warnings.empty());
}

TEST(MeasuredData, TakesCrLfByteOrderMarkQuotesBlanksAndAnyOrder) {
  const MeasuredData d = load(
      "\xEF\xBB\xBFz_mm, y_mm,x_mm,\"q6_deg\",q5_deg,q4_deg,q3_deg,q2_deg,q1_deg\r\n"
      " 3 ,+2,\"1\",60,50,40,30,20,1e1\r\n\r\n\r\n");
  ASSERT_EQ(d.rows.size(), 1U);
  EXPECT_EQ(d.rows[0].position_m, Eigen::Vector3d(0.001, 0.002, 0.003));
  EXPECT_EQ(d.rows[0].q_rad[0], radians(10));
}

TEST(MeasuredData, ReadsPosesWithContext) {
  const MeasuredData d =
      load(joints +
           ",x_mm,y_mm,z_mm,qw,qx,qy,qz,payload_kg,payload_x_mm,payload_y_mm,payload_z_mm,temp_c,time_s,"
           "sigma_mm,sigma_deg,fx_n,fy_n,fz_n,move1_deg,move2_deg,move3_deg,move4_deg,move5_deg,move6_deg\n"
           "10,20,30,40,50,60,1,2,3,-1,0,0,0,2.5,1,2,3,25,60,0.1,0.02,1,2,3,10,-20,0,5,0,0\n");
  const Measurement& m = d.rows[0];
  EXPECT_EQ(d.kind, MeasurementKind::pose);
  EXPECT_EQ(m.orientation.w(), 1);
  EXPECT_EQ(m.context.payload_kg, 2.5);
  EXPECT_EQ(m.context.payload_com_m[2], 0.003);
  EXPECT_EQ(m.context.temperature_c, 25);
  EXPECT_EQ(m.context.time_s, 60);
  EXPECT_EQ(m.context.force_n[1], 2);
  EXPECT_EQ(m.position_sigma_m, 1e-4);
  EXPECT_EQ(m.orientation_sigma_rad, radians(0.02));
  EXPECT_THAT(m.context.direction, ElementsAre(1, -1, 0, 1, 0, 0));
  EXPECT_THAT(m.context.relative_speed, ElementsAre(0.5, -1, 0, 0.25, 0, 0));
  EXPECT_TRUE(d.columns.all_moves());
}

TEST(MeasuredData, DirectionAloneLeavesTheSpeedUnknown) {
  const MeasuredData d = load("dir2,move1_deg," + joints + ",x_mm,y_mm,z_mm\n-1,5,10,20,30,40,50,60,1,2,3\n");
  EXPECT_THAT(d.rows[0].context.direction, ElementsAre(1, -1, 0, 0, 0, 0));
  EXPECT_THAT(d.rows[0].context.relative_speed, ElementsAre(0, 0, 0, 0, 0, 0));
  EXPECT_FALSE(d.columns.all_moves());
  refused("dir2," + joints + ",x_mm,y_mm,z_mm\n0.5,10,20,30,40,50,60,1,2,3\n", 2, "dir2",
          {"-1, 0 (unknown) or 1"});
  refused("dir1,move1_deg," + joints + ",x_mm,y_mm,z_mm\n-1,5,10,20,30,40,50,60,1,2,3\n", 2, "dir1",
          {"the sign of move1_deg"});
}

TEST(MeasuredData, ReadsThreeOrFourReflectors) {
  const std::string abc = joints + ",ax_mm,ay_mm,az_mm,bx_mm,by_mm,bz_mm,cx_mm,cy_mm,cz_mm";
  const MeasuredData three = load(abc + "\n10,20,30,40,50,60,1,2,3,4,5,6,7,8,9\n");
  EXPECT_EQ(three.kind, MeasurementKind::reflectors);
  EXPECT_EQ(three.reflectors, 3U);
  EXPECT_EQ(three.rows[0].reflector_m[2], Eigen::Vector3d(0.007, 0.008, 0.009));
  EXPECT_EQ(load(abc + ",dx_mm,dy_mm,dz_mm\n10,20,30,40,50,60,1,2,3,4,5,6,7,8,9,1,1,1\n").reflectors, 4U);
  refused(abc + ",dx_mm,dy_mm\n10,20,30,40,50,60,1,2,3,4,5,6,7,8,9,1,1\n", 1, "dz_mm", {"this column"});
  refused(abc + ",x_mm,y_mm,z_mm\n10,20,30,40,50,60,1,2,3,4,5,6,7,8,9,1,1,1\n", 1, "",
          {"both a position and reflectors"});
}

TEST(MeasuredData, RefusesAMissingColumn) {
  refused(replaced(good, "q3_deg", "q3_rad"), 1, "q3_deg",
          {"data.csv:1: q3_deg", "joint readings", "but 'q3_rad'"});
  refused(replaced(good, "z_mm", "height"), 1, "z_mm", {"this column"});
  refused(joints + "\n10,20,30,40,50,60\n", 1, "x_mm", {"reflectors ax_mm"});
  refused(joints + ",x_mm,y_mm,z_mm,qw\n10,20,30,40,50,60,1,2,3,1\n", 1, "qx");
}

TEST(MeasuredData, RefusesWhatIsNotANumber) {
  for (const char* text : {"nan", "NaN", "inf", "abc", "1.5.2", "0x1p3", "1;5", "12 13"}) {
    refused(replaced(good, "4,5,6", std::string("4,") + text + ",6"), 3, "y_mm",
            {"data.csv:3: y_mm: expected a finite number, found '" + std::string(text) + "'"});
  }
  refused(replaced(good, "4,5,6", "4,,6"), 3, "y_mm", {"an empty cell"});
  refused(replaced(good, "-10,20", "-10,nan"), 3, "q2_deg");
}

TEST(MeasuredData, SkipsNoRowSilently) {
  refused(replaced(good, "4,5,6\n", "4,5\n"), 3, "", {"9 cells", "found 8"});
  refused(replaced(good, "4,5,6\n", "4,5,6,7\n"), 3, "", {"9 cells", "found 10"});
  refused(replaced(good, "4,5,6\n", "4,5,6\n\n"), 4, "", {"an empty line"});
  refused(replaced(good, "4,5,6\n", "4,5,\"6\n"), 3, "", {"quoted"});
  refused(replaced(good, "y_mm", "x_mm"), 1, "x_mm", {"each column once", "7 and 8"});
  refused("", 1, "", {"header"});
  refused(joints + ",x_mm,y_mm,z_mm\n", 2, "", {"at least one row"});
  expect_refused([] { load_data(support::path_of("absent.csv"), tx60l()); }, 0, "", {"absent.csv"});
}

TEST(MeasuredData, RefusesAJointBeyondItsLimit) {
  refused(replaced(good, "-10,20,30,40,50", "-10,20,30,40,133.6"), 3, "q5_deg",
          {"limits of joint 5", "tx60l.yaml", "-122.5 to 133.5 deg", "'133.6'"});
  EXPECT_NO_THROW(load(replaced(good, "-10,20,30,40,50", "-10,20,30,40,133.5")));
}

TEST(MeasuredData, SuspectsRadians) {
  const std::string text = joints + ",x_mm,y_mm,z_mm\n" +
                           "0.1,0.2,0.3,3.1,0.5,0.6,1,2,3\n-1,0.2,0.3,0.4,0.5,6.2,4,5,6\n" +
                           "1,0.2,0.3,0.4,0.5,-0.6,7,8,9\n";
  refused(text, 0, "q1_deg … q6_deg", {"no reading above 6.2 in 3 rows", "radians"});
  EXPECT_EQ(load(text, {.force = true}).rows.size(), 3U);
  EXPECT_NO_THROW(load(replaced(text, "6.2", "7.1")));
}

TEST(MeasuredData, RefusesARowThatRepeatsAnother) {
  refused(good + "-10,20.0,30,4e1,50,60,4,5,6\n", 5, "", {"every value of line 3 again"});
  // The same pose measured twice has the same readings and other points: line 2 and line 4 of `good`.
  EXPECT_NO_THROW(load(good));
}

TEST(MeasuredData, RefusesAQuaternionThatIsNone) {
  const std::string text = joints + ",x_mm,y_mm,z_mm,qw,qx,qy,qz\n10,20,30,40,50,60,1,2,3,1,0.1,0,0\n";
  refused(text, 2, "qw qx qy qz", {"norm 1.00499"});
  EXPECT_NEAR(load(replaced(text, "0.1", "0.04")).rows[0].orientation.norm(), 1, 1e-15);
}

TEST(MeasuredData, RefusesImpossibleContext) {
  const auto with = [](const std::string& name, const std::string& value) {
    return joints + ",x_mm,y_mm,z_mm," + name + "\n10,20,30,40,50,60,1,2,3," + value + "\n";
  };
  refused(with("payload_kg", "-1"), 2, "payload_kg", {"0 or more"});
  refused(with("sigma_mm", "0"), 2, "sigma_mm", {"above 0"});
  refused(with("sigma_deg", "-0.1"), 2, "sigma_deg", {"above 0"});
}

TEST(MeasuredData, PassesUnknownColumnsThroughWithAWarning) {
  const MeasuredData d = load(joints + ",x_mm,y_mm,z_mm,note,payload\n10,20,30,40,50,60,1,2,3,\"a, b\",1\n");
  EXPECT_THAT(d.extra, ElementsAre("note", "payload"));
  EXPECT_THAT(d.rows[0].extra, ElementsAre("a, b", "1"));
  ASSERT_EQ(d.warnings.size(), 2U);
  EXPECT_THAT(d.warnings[1], HasSubstr("did you mean 'payload_kg'"));
  EXPECT_THAT(data_text(d), HasSubstr("\"a, b\""));
}

TEST(MeasuredData, WarnsWhereNobodySaysHowExactTheDataAre) {
  Robot robot = tx60l();
  robot.has_noise = false;
  EXPECT_THAT(load_data(support::write("data.csv", good), robot).warnings,
              ElementsAre(HasSubstr("sigma_mm")));
}

/// A data file of a kind with random values in every column.
MeasuredData random_data(MeasurementKind kind, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  MeasuredData d;
  d.kind = kind;
  d.reflectors = kind == MeasurementKind::reflectors ? 4 : 0;
  d.columns.payload_mass = d.columns.temperature = d.columns.time = true;
  d.columns.position_sigma = d.columns.orientation_sigma = true;
  d.columns.payload_com.fill(true);
  d.columns.force.fill(true);
  d.columns.move.fill(true);
  for (int k = 0; k < 200; ++k) {
    Measurement m;
    for (std::size_t j = 0; j < 6; ++j) {
      m.q_rad[j] = 2 * u(random);
      m.move_rad[j] = u(random);
    }
    const auto v = [&] { return Eigen::Vector3d(u(random), u(random), u(random)); };
    m.position_m = v();
    m.orientation = Eigen::Quaterniond(1 + u(random), u(random), u(random), u(random)).normalized();
    for (auto& p : m.reflector_m) p = v();
    m.context.payload_kg = 1 + u(random);
    m.context.temperature_c = 20 + u(random);
    m.context.time_s = 1e4 * u(random);
    for (std::size_t i = 0; i < 3; ++i) {
      m.context.payload_com_m[i] = u(random);
      m.context.force_n[i] = u(random);
    }
    m.position_sigma_m = 1.001 + u(random);
    m.orientation_sigma_rad = 1.001 + u(random);
    d.rows.push_back(m);
  }
  return d;
}

TEST(MeasuredData, ReadsBackTheIdenticalDoubles) {
  for (const MeasurementKind kind :
       {MeasurementKind::position, MeasurementKind::pose, MeasurementKind::reflectors}) {
    const MeasuredData written = random_data(kind, 11);
    const std::string path = support::path_of("round.csv");
    save_data(path, written);
    const MeasuredData again = load_data(path, tx60l());
    ASSERT_EQ(again.rows.size(), written.rows.size());
    for (std::size_t k = 0; k < written.rows.size(); ++k) {
      const Measurement& a = written.rows[k];
      const Measurement& b = again.rows[k];
      const auto parts = [](const Measurement& m) {
        const auto& c = m.context;
        return std::tuple(m.q_rad, m.move_rad, c.payload_kg, c.payload_com_m, c.force_n, c.time_s,
                          c.temperature_c, m.position_sigma_m, m.orientation_sigma_rad);
      };
      EXPECT_EQ(parts(a), parts(b)) << k;
      if (kind != MeasurementKind::reflectors) {
        EXPECT_EQ(a.position_m, b.position_m);
      }
      if (kind == MeasurementKind::pose) {
        EXPECT_EQ(a.orientation.coeffs(), b.orientation.coeffs());
      }
      if (kind == MeasurementKind::reflectors) {
        EXPECT_EQ(a.reflector_m, b.reflector_m);
      }
    }
    EXPECT_EQ(data_text(again), support::read(path));
  }
}

TEST(Targets, JointsOrPosesWithSeeds) {
  const TargetsFile t = targets(joints + ",payload_kg\n10,20,30,40,50,200,2\n10,20,30,40,50,400,2\n");
  EXPECT_FALSE(t.poses);
  EXPECT_EQ(t.rows[1].q_rad[5], radians(400));  // beyond the limit: answered by status, not by a refusal
  EXPECT_EQ(t.rows[1].context.payload_kg, 2);

  const std::string pose = "x_mm,y_mm,z_mm,qw,qx,qy,qz";
  const std::string seeds = "seed1_deg,seed2_deg,seed3_deg,seed4_deg,seed5_deg,seed6_deg";
  const TargetsFile p = targets(pose + "," + seeds + "\n1,2,3,1,0,0,0,10,20,30,40,50,60\n");
  EXPECT_TRUE(p.poses);
  EXPECT_EQ(p.rows[0].q_rad[5], radians(60));
  EXPECT_EQ(p.rows[0].position_m.z(), 0.003);
  expect_refused([&] { targets(pose + "\n1,2,3,1,0,0,0\n"); }, 1, "seed1_deg", {"choose the branch"});
  expect_refused([&] { targets("x_mm,y_mm,z_mm\n1,2,3\n"); }, 1, "qw");
  expect_refused([&] { targets(joints + ",status\n10,20,30,40,50,60,ok\n"); }, 1, "status", {"compensate"});
  expect_refused([&] { targets("a,b\n1,2\n"); }, 1, "q1_deg", {"targets"});
}

TEST(RealData, EverySetLoads) {
  const char* given = std::getenv("FLEXCOMP_DATA");
  const std::string folder = given != nullptr ? given : FLEXCOMP_SOURCE_DIR "/../shared/data";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "REAL DATA: not run, " << folder << " is absent";
  const Robot ur5 = load_robot(folder + "/ur5-jacobi/robot.yaml");
  const Robot ur10 = load_robot(folder + "/ur10-ipa/robot.yaml");
  EXPECT_EQ(load_data(folder + "/ur5-jacobi/grid.csv", ur5).rows.size(), 1000U);
  EXPECT_EQ(load_data(folder + "/ur5-jacobi/random.csv", ur5).rows.size(), 20U);
  EXPECT_EQ(load_data(folder + "/ur10-ipa/series_a.csv", ur10).rows.size(), 11911U);
  EXPECT_EQ(load_data(folder + "/ur10-ipa/series_b.csv", ur10).rows.size(), 1495U);
}

}  // namespace data_files
