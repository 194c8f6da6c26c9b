// SPDX-License-Identifier: Apache-2.0
// Arms from URDF: the same motion as KDL's chain of the same drawing, lengths of the arm's size, refusals that say why.
#include "exchange/urdf_file.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <tuple>
#include <vector>

#include "exchange/axis_chain.hpp"
#include "exchange/imported_arm.hpp"
#include "flexcomp/identification.hpp"
#include "model/paper_model.hpp"
#include "support/arms.hpp"
#include "support/drawn_arm.hpp"
#include "support/moving_arm.hpp"
#include "support/mutation.hpp"
#include "support/robot_files.hpp"
#include "support/text_file.hpp"
#include "units.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;
using arms::Joints;
using drawn::Arm;
using support::data;
using support::expect_refused;
using support::MovingArm;
using support::replaced;
using support::robots;

constexpr double bound = 1e-9;  // m and rad

struct Difference {
  double position_m = 0;
  double angle_rad = 0;

  void add(const Pose<double>& a, const Pose<double>& b) {
    position_m = std::max(position_m, (a.position - b.position).norm());
    angle_rad = std::max(angle_rad, arms::angle_between(a.rotation, b.rotation));
  }
  bool within(double most) const { return position_m <= most && angle_rad <= most; }
};

/// Of the two over 1000 random readings.
template <class A, class B>
Difference worst_of(const A& a, B&& b, std::uint64_t seed) {
  arms::Random random(seed);
  Difference worst;
  for (int k = 0; k < 1000; ++k) {
    const Joints q = random.joints(3.1);
    worst.add(a(q), b(q));
  }
  return worst;
}

Pose<double> turned_about_x() {
  Pose<double> pose;
  pose.rotation = Eigen::Vector3d(1, -1, -1).asDiagonal();
  return pose;
}

// --- the robots of the project ------------------------------------------------------------------------------------

/// Robot file, the drawing of its source, and what lies between their frames.
struct Sourced {
  const char* file;
  Arm source;
  Pose<double> base_to_f0;
};

TEST(RobotsOfTheProject, MoveAsTheirSourcesDo) {
  Pose<double> foot_to_shoulder;
  foot_to_shoulder.position = {0, 0, 0.375};
  for (const Sourced& s : {Sourced{"kuka-kr6-r900", drawn::kuka_kr6_r900(), turned_about_x()},
                           Sourced{"abb-irb120", drawn::abb_irb120(), Pose<double>()},
                           Sourced{"rx160l", drawn::rx160l(), Pose<double>()},
                           Sourced{"tx60l", drawn::tx60l(), foot_to_shoulder}}) {
    Robot robot = support::robot(s.file);
    // What is mounted is the project's own; the source ends at the flange.
    robot.nominal.tool_xyz_m = {};
    robot.nominal.tool_wxyz = {1, 0, 0, 0};
    const MovingArm ours(robot);
    drawn::Judge judge(s.source);
    const Difference worst = worst_of([&](const Joints& q) { return s.base_to_f0 * ours(q); }, judge, 1);
    std::printf("%s: %.1e m, %.1e rad\n", s.file, worst.position_m, worst.angle_rad);
    EXPECT_TRUE(worst.within(1e-12)) << s.file;
  }
}

// The maker's Denavit-Hartenberg table and the URDF differ by constant frames at both ends, and by the right angles of the
// URDF, which are 2e-9 rad off.
TEST(RobotsOfTheProject, Ur5MovesAsItsUrdf) {
  const MovingArm ours(support::robot("ur5"));
  drawn::Judge judge(drawn::ur5());
  Pose<double> half_turn;
  half_turn.rotation = Eigen::Vector3d(-1, -1, 1).asDiagonal();
  const Pose<double> zero = half_turn * ours(Joints{});
  const Pose<double> theirs = judge(Joints{});
  const Pose<double> end{zero.rotation.transpose() * theirs.rotation,
                         zero.rotation.transpose() * (theirs.position - zero.position)};
  EXPECT_LT(end.position.norm(), 1e-8);
  const Difference worst = worst_of([&](const Joints& q) { return half_turn * ours(q) * end; }, judge, 2);
  EXPECT_TRUE(worst.within(2e-8)) << worst.position_m << " " << worst.angle_rad;
}

TEST(RobotsOfTheProject, TheirUrdfsGiveTheFilesLinks) {
  for (const auto& [file, urdf, base] :
       {std::array<std::string, 3>{"kuka-kr6-r900", "kuka_kr6_r900.urdf", ""},
        std::array<std::string, 3>{"abb-irb120", "abb_irb120.urdf", "base_link"},
        std::array<std::string, 3>{"tx60l", "tx60l.urdf", "base"}}) {
    const Robot robot = support::robot(file);
    const ImportedArm arm = import_urdf(data + urdf, {base, "", ""});
    EXPECT_EQ(nominal_hash(arm.robot.nominal), nominal_hash(robot.nominal)) << file;
    EXPECT_EQ(arm.robot.name, robot.name);
    EXPECT_TRUE(arm.warnings.empty());
    for (std::size_t i = 0; i < 6; ++i) {
      // URDFs write limits as rounded radians, and the paper's TX60L has a shorter elbow range.
      if (file == "tx60l") continue;
      EXPECT_NEAR(arm.robot.nominal.limits[i].min_rad, robot.nominal.limits[i].min_rad, radians(1e-3))
          << file << i;
      EXPECT_NEAR(arm.robot.nominal.limits[i].max_rad, robot.nominal.limits[i].max_rad, radians(1e-3))
          << file << i;
      EXPECT_NEAR(arm.robot.max_speed_rad_s[i], robot.max_speed_rad_s[i], radians(1e-3)) << file << i;
    }
  }
}

TEST(RobotsOfTheProject, LinkWeightSagsOnEveryOne) {
  for (const auto& entry : std::filesystem::directory_iterator(robots)) {
    const Robot robot = load_robot(entry.path().string());
    EXPECT_TRUE(gravity_is_axial(robot.nominal)) << entry.path();
    ParametricModel model;
    EffectId id;
    id.effect = Effect::link_gravity;
    add_effect(model, id, robot.nominal);
    for (const Parameter& p : model.parameters) p.set(model.set, 1e-3);
    const MovingArm sagging(robot, model.set);
    const MovingArm ideal(robot);
    arms::Random random(3);
    const Eigen::Vector3d down = Eigen::Vector3d(robot.nominal.gravity_m_s2[0], robot.nominal.gravity_m_s2[1],
                                                 robot.nominal.gravity_m_s2[2])
                                     .normalized();
    // The wrist's centre goes down or stays, wherever the arm reaches; a pose straight up or down does neither.
    double lowest = 0;
    double highest = 0;
    for (int k = 0; k < 200; ++k) {
      Joints q = random.pose(robot.nominal);
      q[2] = q[3] = q[4] = q[5] = 0;  // the forearm follows the upper arm
      const double sunk = (sagging(q).position - ideal(q).position).dot(down);
      lowest = std::max(lowest, sunk);
      highest = std::min(highest, sunk);
    }
    EXPECT_GT(lowest, 1e-4) << entry.path();
    EXPECT_GT(highest, -0.2 * lowest) << entry.path();
  }
}

// --- random drawings ----------------------------------------------------------------------------------------------

Eigen::Vector3d unit_vector(arms::Random& random) {
  for (;;) {
    const Eigen::Vector3d v(random.around(1), random.around(1), random.around(1));
    if (v.norm() > 0.1 && v.norm() < 1) return v.normalized();
  }
}

Eigen::Vector3d across(const Eigen::Vector3d& v, arms::Random& random) {
  return v.cross(unit_vector(random)).normalized();
}

Eigen::Matrix3d rotation(const drawn::Vec3& rpy) {
  return (Eigen::AngleAxisd(rpy[2], Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(rpy[1], Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(rpy[0], Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

drawn::Vec3 triple(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

constexpr int neighbours = 8;

/// A joint whose axis stands to the one before (`axis` through `point`, in the frame before) as `kind` says.
drawn::Joint next_joint(int kind, Eigen::Vector3d axis, const Eigen::Vector3d& point, arms::Random& random) {
  Eigen::Vector3d direction = unit_vector(random);
  Eigen::Vector3d origin = unit_vector(random) * random.uniform(0, 0.6);
  const double sign = random.below(2) == 0 ? 1 : -1;
  const double tilt = std::pow(10.0, random.uniform(-9, -0.7));
  switch (kind) {
    case 0:  // any
      break;
    case 1:  // a right angle that meets
      direction = across(axis, random);
      origin = point + axis * random.around(0.5);
      break;
    case 2:  // meets at any angle
      origin = point + axis * random.around(0.5);
      break;
    case 3:  // parallel or antiparallel
      direction = sign * axis;
      break;
    case 4:  // nearly so, crossing
      direction = sign * (axis + tilt * across(axis, random)).normalized();
      break;
    case 5:  // nearly so, meeting: there the common normal's feet are the meeting point, which may be anywhere
      direction = sign * (axis + tilt * across(axis, random)).normalized();
      origin = point + axis * random.around(0.5);
      break;
    case 6:  // the same line
      direction = sign * axis;
      origin = point + axis * random.around(0.5);
      break;
    default:  // nearly the same line
      direction = sign * (axis + tilt * across(axis, random)).normalized();
      origin = point + axis * random.around(0.5) + across(axis, random) * tilt * random.uniform(0, 0.5);
  }
  drawn::Joint joint;
  joint.xyz_m = triple(origin);
  joint.rpy_rad = {random.around(3), random.around(1.5), random.around(3)};
  // URDF asks for no unit vectors.
  joint.axis = triple(rotation(joint.rpy_rad).transpose() * direction * random.uniform(0.5, 2));
  return joint;
}

Arm random_arm(arms::Random& random) {
  Arm arm;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  for (int i = 0; i < 6; ++i) {
    const drawn::Joint joint = next_joint(static_cast<int>(random.below(neighbours)), axis, point, random);
    arm.push_back(joint);
    axis = Eigen::Vector3d(joint.axis[0], joint.axis[1], joint.axis[2]).normalized();
    point.setZero();
    if (random.below(4) == 0) {
      drawn::Joint fixed;
      fixed.xyz_m = triple(unit_vector(random) * 0.1);
      fixed.rpy_rad = {random.around(3), random.around(1.5), random.around(3)};
      const Eigen::Matrix3d r = rotation(fixed.rpy_rad);
      const Eigen::Vector3d p(fixed.xyz_m[0], fixed.xyz_m[1], fixed.xyz_m[2]);
      axis = r.transpose() * axis;
      point = r.transpose() * (point - p);
      arm.push_back(fixed);
    }
  }
  if (random.below(2) == 0)
    arm.push_back({triple(unit_vector(random) * 0.2), {random.around(3), 0.3, 1}, {}});
  return arm;
}

TEST(Urdf, RandomArmsMoveAsTheirDrawingsAndNoLengthRunsOff) {
  arms::Random random(7);
  double longest = 0;
  Difference worst;
  int bases = 0;
  for (int n = 0; n < 2000; ++n) {
    const Arm arm = random_arm(random);
    const ImportedArm imported =
        import_urdf(support::write("arm" + std::to_string(n) + ".urdf", drawn::urdf(arm)), {});
    const Robot robot = load_robot(
        support::write("arm" + std::to_string(n) + ".yaml", robot_text(imported.robot, {"of a test"})));
    ASSERT_EQ(nominal_hash(robot.nominal), nominal_hash(imported.robot.nominal)) << n;
    ASSERT_EQ(robot.nominal.tool_xyz_m, imported.robot.nominal.tool_xyz_m);
    ASSERT_EQ(robot.nominal.tool_wxyz, imported.robot.nominal.tool_wxyz);
    const MovingArm ours(robot);
    drawn::Judge judge(arm);
    Difference here;
    for (int k = 0; k < 5; ++k) {
      const Joints q = random.joints(3.1);
      here.add(imported.base_to_f0 * ours(q), judge(q));
    }
    ASSERT_TRUE(here.within(bound)) << n << ": " << here.position_m << " m, " << here.angle_rad << " rad\n"
                                    << drawn::urdf(arm) << robot_text(robot, {});
    worst.position_m = std::max(worst.position_m, here.position_m);
    worst.angle_rad = std::max(worst.angle_rad, here.angle_rad);
    for (const NominalLink& link : robot.nominal.links) {
      longest = std::max(
          {longest, std::abs(link.d_m) / drawn::size_m(arm), std::abs(link.a_m) / drawn::size_m(arm)});
      ASSERT_LE(std::abs(link.theta_rad), host::pi + 1e-12);
    }
    ASSERT_EQ(imported.f0_is_base,
              imported.base_to_f0.rotation.isIdentity(0) && imported.base_to_f0.position.isZero(0));
    bases += imported.f0_is_base ? 1 : 0;
  }
  std::printf("2000 arms: %.1e m, %.1e rad; longest length %.2f of the arm; F0 is the base %d times\n",
              worst.position_m, worst.angle_rad, longest, bases);
  EXPECT_LT(longest, 4);
  EXPECT_GT(bases, 100);
}

TEST(Urdf, F0IsTheNearestFrameToTheBase) {
  // A joint 1 that is tilted by 0.2 rad about x and passes beside the base's origin.
  Arm arm = drawn::abb_irb120();
  arm[0] = {{0.3, 0.1, 0.7}, {0.2, 0, 0}, {0, 0, 1}};
  const ImportedArm imported = import_urdf(support::write("tilted.urdf", drawn::urdf(arm)), {});
  EXPECT_FALSE(imported.f0_is_base);
  const Pose<double>& f0 = imported.base_to_f0;
  const Eigen::Vector3d axis = rotation({0.2, 0, 0}).col(2);
  EXPECT_LT((f0.rotation.col(2) - axis).norm(), 1e-12);
  EXPECT_NEAR(Eigen::AngleAxisd(f0.rotation).angle(), 0.2, 1e-12);
  EXPECT_NEAR(f0.position.dot(axis), 0, 1e-12);  // nearest to the origin
  EXPECT_LT((f0.position - Eigen::Vector3d(0.3, 0.1, 0.7)).cross(axis).norm(), 1e-12);  // on the axis
  const auto& g = imported.robot.nominal.gravity_m_s2;
  EXPECT_LT(
      (Eigen::Vector3d(g[0], g[1], g[2]) - f0.rotation.transpose() * Eigen::Vector3d(0, 0, -9.81)).norm(),
      1e-4);
}

TEST(Urdf, GravityIsTheRootsOnAWall) {
  // The whole arm hangs by its base_link, a quarter turn about y from the world.
  std::string text = replaced(drawn::urdf(drawn::abb_irb120()), "<link name=\"l0\"/>",
                              "<link name=\"world\"/><link name=\"l0\"/><joint name=\"wall\" type=\"fixed\">"
                              "<parent link=\"world\"/><child link=\"l0\"/>"
                              "<origin xyz=\"1 2 3\" rpy=\"0 1.5707963267948966 0\"/></joint>");
  const ImportedArm imported = import_urdf(support::write("wall.urdf", text), {"l0", "", ""});
  EXPECT_TRUE(imported.f0_is_base);
  EXPECT_EQ(imported.robot.nominal.gravity_m_s2, (std::array<double, 3>{9.81, 0, 0}));
  EXPECT_FALSE(import_urdf(support::write("wall.urdf", text), {}).f0_is_base);
}

TEST(Urdf, ALevelBaseIsLevelWhereTheFileRoundsItsRightAngles) {
  Arm arm = drawn::abb_irb120();
  arm[0] = {
      {0, 0, 0}, {1.5708, 0, 0}, {0, -1, 0}};  // about the base's z, but for 4e-6 rad: as many files have it
  const ImportedArm imported = import_urdf(support::write("level.urdf", drawn::urdf(arm)), {});
  EXPECT_FALSE(imported.f0_is_base);
  EXPECT_EQ(std::abs(imported.robot.nominal.gravity_m_s2[2]), 9.81);
  EXPECT_TRUE(gravity_is_axial(imported.robot.nominal));
}

TEST(Urdf, F6IsTheFlangeAndTheToolTheRest) {
  // A tip 200 mm before tool0 and turned: F6 stays at tool0.
  std::string text = drawn::urdf(drawn::abb_irb120());
  text = replaced(text, "<link name=\"l8\"/>", "<link name=\"left_tool0\"/><link name=\"tip\"/>");
  text = replaced(text, "<child link=\"l8\"/>", "<child link=\"left_tool0\"/>");
  text = replaced(text, "</robot>",
                  "<joint name=\"mount\" type=\"fixed\"><parent link=\"left_tool0\"/><child link=\"tip\"/>"
                  "<origin xyz=\"0.01 0.02 0.2\" rpy=\"0 0 1.5707963267948966\"/></joint></robot>");
  const std::string path = support::write("tool.urdf", text);
  const ImportedArm imported = import_urdf(path, {});
  EXPECT_EQ(imported.flange, "left_tool0");
  EXPECT_EQ(imported.tip, "tip");
  EXPECT_EQ(imported.robot.nominal.links[5].d_m, 0.072);
  EXPECT_EQ(imported.robot.nominal.tool_xyz_m, (std::array<double, 3>{0.01, 0.02, 0.2}));
  EXPECT_NEAR(imported.robot.nominal.tool_wxyz[3], std::sqrt(0.5), 1e-15);
  EXPECT_EQ(import_urdf(path, {"", "", "tip"}).robot.nominal.links[5].d_m, 0.272);
  EXPECT_EQ(import_urdf(path, {"", "left_tool0", ""}).robot.nominal.tool_xyz_m,
            (std::array<double, 3>{0, 0, 0}));
}

// --- robot files with lengths that ran off ------------------------------------------------------------------------

/// A UR5 as the maker calibrates it: axes 2 and 3, 3 and 4 a few 1e-5 rad off parallel, in plain Denavit-Hartenberg.
std::string calibrated_ur5() {
  std::string text = support::read(robots + "ur5.yaml");
  text = replaced(text, "{theta_deg: 0, d_mm: 0, a_mm: -425, alpha_deg: 0,",
                  "{theta_deg: 11.2, d_mm: 439140.3, a_mm: -416.9, alpha_deg: 0.0171,");
  text = replaced(text, "{theta_deg: 0, d_mm: 0, a_mm: -392.25, alpha_deg: 0,",
                  "{theta_deg: 348.9, d_mm: -446027.1, a_mm: -392.1, alpha_deg: 0.0213,");
  return replaced(text, "d_mm: 109.15,", "d_mm: 6996.2,");
}

TEST(LongLinks, AreRefusedWithTheWayOut) {
  const std::string path = support::write("calibrated.yaml", calibrated_ur5());
  try {
    load_robot(path);
    FAIL() << "439 m of d were taken";
  } catch (const InputError& e) {
    EXPECT_EQ(e.field(), "joints[2].d_mm");
    for (const char* part : {"calibrated.yaml:", "20000 mm", "nearly parallel", "439140.3"})
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    EXPECT_EQ(e.code(), ErrorCode::long_links);
  }
  EXPECT_NO_THROW(load_robot(path, LongLinks::taken));
}

TEST(LongLinks, ImportPutsBetaInTheirPlace) {
  const std::string calibrated = calibrated_ur5();
  std::string text =
      replaced(calibrated.substr(0, calibrated.find("capsules:")), "payload: {mass_kg: 0, com_mm: [0, 0, 0]}",
               "payload: {mass_kg: 2, com_mm: [5, 8, 60]}\ncapsules:\n"
               "  - {frame: 3, from_mm: [0, 0, 0], to_mm: [392, 0, 7000], radius_mm: 60}");
  const std::string path = support::write("calibrated.yaml", text);
  const Robot before = load_robot(path, LongLinks::taken);
  const ImportedArm imported = import_robot(path);
  EXPECT_TRUE(imported.f0_is_base);
  const Robot after = load_robot(support::write("anew.yaml", robot_text(imported.robot, {})));
  for (const NominalLink& link : after.nominal.links) {
    EXPECT_LT(std::abs(link.d_m), 1);
    EXPECT_LT(std::abs(link.a_m), 1);
  }
  EXPECT_NE(after.nominal.links[1].beta_rad, 0);
  // Of 439 m a double knows 6e-14, and the angles of its ends turn that by whole turns.
  const Difference worst = worst_of(MovingArm(before), MovingArm(after), 5);
  EXPECT_TRUE(worst.within(bound)) << worst.position_m << " " << worst.angle_rad;
  EXPECT_EQ(after.nominal.payload_kg, 2);
  EXPECT_NEAR(after.nominal.payload_com_m[2], 0.06, 1e-12);
  ASSERT_EQ(after.capsules.size(), 1U);
  EXPECT_NEAR((after.capsules[0].to_m - after.capsules[0].from_m).norm(), std::hypot(0.392, 7), 1e-9);
}

TEST(RobotText, GivesEveryRobotOfTheProjectBack) {
  for (const auto& entry : std::filesystem::directory_iterator(robots)) {
    const Robot a = load_robot(entry.path().string());
    const Robot b = load_robot(support::write("again.yaml", robot_text(a, {"one", "", "two\nname: other"})));
    const auto parts = [](const Robot& r) {
      const NominalRobot<6>& n = r.nominal;
      return std::tuple(r.name, nominal_hash(n), n.gravity_m_s2, n.tool_xyz_m, n.tool_wxyz, n.payload_kg,
                        n.payload_com_m, n.reference_temperature_c, r.reflectors_m, r.position_sigma_m,
                        r.orientation_sigma_rad, r.max_speed_rad_s, r.gear_ratio);
    };
    EXPECT_EQ(parts(a), parts(b)) << a.name;
    ASSERT_EQ(a.capsules.size(), b.capsules.size());
    for (std::size_t k = 0; k < a.capsules.size(); ++k) {
      EXPECT_EQ(a.capsules[k].frame, b.capsules[k].frame);
      EXPECT_EQ(a.capsules[k].from_m, b.capsules[k].from_m);
      EXPECT_EQ(a.capsules[k].to_m, b.capsules[k].to_m);
      EXPECT_EQ(a.capsules[k].radius_m, b.capsules[k].radius_m);
    }
    for (std::size_t i = 0; i < 6; ++i) {
      EXPECT_EQ(a.nominal.limits[i].min_rad, b.nominal.limits[i].min_rad);
      EXPECT_EQ(a.nominal.limits[i].max_rad, b.nominal.limits[i].max_rad);
    }
  }
}

// --- refusals -----------------------------------------------------------------------------------------------------

const std::string kuka = support::read(data + "kuka_kr6_r900.urdf");

/// Refused with this field and parts; nothing is printed.
void refused(const std::string& text, const std::string& field, const std::vector<std::string>& parts,
             const UrdfLinks& links = {}) {
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  try {
    import_urdf(support::write("bad.urdf", text), links);
    ADD_FAILURE() << "was accepted; expected a refusal of " << field;
  } catch (const InputError& e) {
    EXPECT_EQ(e.field(), field) << e.what();
    EXPECT_NE(std::string(e.what()).find("bad.urdf"), std::string::npos) << e.what();
    for (const std::string& part : parts) EXPECT_THAT(e.what(), testing::HasSubstr(part));
  }
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(UrdfRefusals, FilesThatAreNone) {
  expect_refused([] { import_urdf(support::path_of("absent.urdf"), {}); }, 0, "", {"can be read"});
  expect_refused([] { import_urdf(support::path_of(""), {}); }, 0, "", {"can be read"});
  refused("", "", {"can be read"});
  refused("joints: 6\n", "", {"XML"});
  refused("<robot name=\"x\">\n<link name=\"a\"/>\n</joint></robot>", "", {"bad.urdf:3", "XML"});
  refused("<sdf version=\"1.6\"/>", "", {"<robot>", "found <sdf>"});
  refused("<robot name=\"x\"/>", "", {"URDF"});
  refused("<robot name=\"x\" xmlns:xacro=\"u\">\n<xacro:arm prefix=\"\"/></robot>", "",
          {":2", "xacro FILE >", "<xacro:arm>"});
  refused(replaced(kuka, " name=\"kuka-kr6-r900-sixx\"", ""), "", {"URDF", "name"});
  for (const char* numbers :
       {"0.455 0", "0.455 nan 0", "0.455 0 0 0", "0.455 0 0 x", "0.455 0 1e999", "", "a"}) {
    refused(replaced(kuka, "0.455 0 0", numbers), "joint 'joint_a3'",
            {"bad.urdf:32: ", "URDF", "xyz", fmt::format("'{}'", numbers)});
  }
  refused(replaced(kuka, "<child link=\"link_3\"/>", "<child link=\"link_9\"/>"), "joint 'joint_a3'",
          {"bad.urdf:29: ", "URDF", "child", "'link_9'"});
  refused(replaced(kuka, "<child link=\"link_3\"/>", ""), "joint 'joint_a3'", {"URDF", "child", "nothing"});
  refused(replaced(kuka, "<child link=\"link_3\"/>", "<child link=\"link_1\"/>"), "joint 'joint_a3'",
          {"URDF", "one joint", "'link_1' on 'joint_a1'"});
  refused(replaced(kuka, "<link name=\"tool0\"/>", "<link name=\"tool0\"/><link name=\"tool0\"/>"), "",
          {"URDF", "each link once", "tool0"});
  refused(replaced(kuka, "<link name=\"tool0\"/>", "<link name=\"tool0\"/><link/>"), "",
          {"<link> has a name"});
  refused(replaced(kuka, "</robot>", "<link name=\"alone\"/></robot>"), "link 'base_link'",
          {"one root", "'alone' as well"});
  const std::string ring =
      "<link name=\"r1\"/><link name=\"r2\"/><link name=\"r3\"/>"
      "<joint name=\"j1\" type=\"fixed\"><parent link=\"r1\"/><child link=\"r2\"/></joint>"
      "<joint name=\"j2\" type=\"fixed\"><parent link=\"r2\"/><child link=\"r1\"/></joint>"
      "<joint name=\"j3\" type=\"fixed\"><parent link=\"r1\"/><child link=\"r3\"/></joint></robot>";
  refused(replaced(kuka, "</robot>", ring), "link 'r1'", {"tree", "ring"});
}

TEST(UrdfRefusals, JointsThatAreNotSixTurningOnes) {
  const std::string a3 = "name=\"joint_a3\" type=\"revolute\"";
  refused(replaced(kuka, a3, "name=\"joint_a3\" type=\"prismatic\""), "joint 'joint_a3'",
          {"revolute, continuous or fixed", "prismatic"}, {"", "tool0", ""});
  refused(replaced(kuka, a3, "name=\"joint_a3\" type=\"floating\""), "joint 'joint_a3'", {"floating"},
          {"", "tool0", ""});
  refused(replaced(kuka, a3, "name=\"joint_a3\" type=\"fixed\""), "link 'tool0'",
          {"exactly six", "5: joint_a1, joint_a2, joint_a4"}, {"", "tool0", ""});
  refused(
      replaced(kuka, "name=\"joint_a6-tool0\" type=\"fixed\"", "name=\"joint_a6-tool0\" type=\"continuous\""),
      "link 'tool0'", {"exactly six", "7: "}, {"", "tool0", ""});
  refused(replaced(kuka, a3, "name=\"joint_a3\" type=\"twisting\""), "joint 'joint_a3'",
          {"bad.urdf:29: ", "URDF", "'twisting'"});
  refused(
      replaced(kuka, "<limit effort=\"0\" lower=\"-2.0943951023931953\" upper=\"2.7", "<range upper=\"2.7"),
      "joint 'joint_a3'", {"<limit>", "none"});
  refused(replaced(kuka, "<axis xyz=\"-1 0 0\"/>", "<axis xyz=\"0 0 0\"/>"), "joint 'joint_a4'",
          {"a direction", "0 0 0"});
  refused(replaced(kuka, "<axis xyz=\"-1 0 0\"/>", "<axis xyz=\"-1 0 0\"/><mimic joint=\"joint_a1\"/>"),
          "joint 'joint_a4'", {"mimics 'joint_a1'"});
  refused(replaced(kuka, "upper=\"0.7853981633974483\"", "upper=\"-4\""), "joint 'joint_a2'",
          {"bad.urdf:22: ", "lower limit below", "-4"});
}

// Found by fuzzing: both wrote robot files with numbers that are none.
TEST(UrdfRefusals, NumbersAtTheEndOfTheRange) {
  const auto imported = [](const std::string& text) {
    return import_urdf(support::write("ends.urdf", text), {});
  };
  const ImportedArm far = imported(replaced(kuka, "<axis xyz=\"-1 0 0\"/>", "<axis xyz=\"-1e308 0 0\"/>"));
  const ImportedArm near = imported(kuka);
  EXPECT_EQ(nominal_hash(far.robot.nominal), nominal_hash(near.robot.nominal)) << "the same direction";
  refused(replaced(kuka, "0.455 0 0", "1e308 1e308 1e308"), "", {"finite places"});
}

TEST(UrdfRefusals, LinksThatAreNotThere) {
  refused(kuka, "tip", {"did you mean 'tool0'", "'tool'"}, {"", "tool", ""});
  refused(kuka, "base", {"one of the links", "base_link", "'zzzzzzzz'"}, {"zzzzzzzz", "", ""});
  refused(kuka, "flange", {"a link from link_6 to tool0", "'link_5'"}, {"", "", "link_5"});
  refused(kuka, "link 'link_5'", {"exactly six", "5: "}, {"", "link_5", ""});
  refused(kuka, "joint 'joint_a1'", {"fixed joints alone"}, {"link_1", "base", ""});
  const std::string fingers =
      "<link name=\"left\"/><link name=\"right\"/>"
      "<joint name=\"l\" type=\"fixed\"><parent link=\"tool0\"/><child link=\"left\"/></joint>"
      "<joint name=\"r\" type=\"fixed\"><parent link=\"tool0\"/><child link=\"right\"/></joint></robot>";
  refused(replaced(kuka, "</robot>", fingers), "tip", {"which of several", "left, right"});
  EXPECT_EQ(
      import_urdf(support::write("good.urdf", replaced(kuka, "</robot>", fingers)), {"", "left", ""}).flange,
      "tool0");
  refused(replaced(kuka, "type=\"revolute\"", "type=\"fixed\""), "tip",
          {"six revolute", "base after 0", "tool0 after 5"});
}

TEST(Urdf, JointsWithoutLimitsTurnOnceEitherWayWithAWarning) {
  const std::string endless =
      replaced(kuka, "name=\"joint_a6\" type=\"revolute\"", "name=\"joint_a6\" type=\"continuous\"");
  const std::string huge = replaced(kuka, "lower=\"-6.1086523819801535\" upper=\"6.1086523819801535\"",
                                    "lower=\"-1e16\" upper=\"1e16\"");
  for (const std::string& text : {endless, huge}) {
    const ImportedArm arm = import_urdf(support::write("endless.urdf", text), {});
    EXPECT_EQ(arm.robot.nominal.limits[5].min_rad, radians(-360));
    EXPECT_EQ(arm.robot.nominal.limits[5].max_rad, radians(360));
    ASSERT_EQ(arm.warnings.size(), 1U);
    EXPECT_THAT(arm.warnings[0], testing::HasSubstr("joint_a6"));
  }
}

// Whatever becomes of a file: an arm with finite numbers, or a refusal.
TEST(Urdf, BrokenFilesAreRefusedOrRead) {
  int taken = 0;
  support::refused_mutations(kuka, {2000, "", 45}, [&taken](const std::string& text) {
    const ImportedArm arm = import_urdf(support::write("broken.urdf", text), {});
    ++taken;
    for (const NominalLink& l : arm.robot.nominal.links)
      ASSERT_TRUE(std::isfinite(l.theta_rad + l.d_m + l.a_m + l.alpha_rad + l.beta_rad)) << text;
    if (arm.robot.name.empty()) return;
    // What was read is written so that it is read again, unless it is longer than any arm.
    const std::string again = support::write("broken.yaml", robot_text(arm.robot, {arm.tip}));
    EXPECT_EQ(nominal_hash(load_robot(again, LongLinks::taken).nominal), nominal_hash(arm.robot.nominal));
  });
  std::printf("%d of 2000 broken files were still an arm\n", taken);
  EXPECT_GT(taken, 20);
  EXPECT_LT(taken, 1900);
}

}  // namespace
