// SPDX-License-Identifier: Apache-2.0
// A calibration in a URDF: read by liburdfdom and put into a chain of KDL, neither of which shares code with us, the tip of
// the exported file goes where the rigid part of our forward model goes; all other bytes are the user's.
#include "exchange/corrected_urdf.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "exchange/imported_arm.hpp"
#include "exchange/rotation_angles.hpp"
#include "files/calibration_file.hpp"
#include "model/frames.hpp"
#include "support/arms.hpp"
#include "support/drawn_arm.hpp"
#include "support/moving_arm.hpp"
#include "support/robot_files.hpp"
#include "support/text_file.hpp"
#include "units.hpp"

namespace {

using namespace flexcomp;
using namespace flexcomp::host;
using support::data;
using support::MovingArm;
using support::replaced;

/// Judges the tip of a URDF in one of its links, by liburdfdom and KDL.
drawn::Judge judge_of(const std::string& text, const std::string& base, const std::string& tip) {
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(text);
  if (!model) throw std::runtime_error("no URDF");
  std::vector<urdf::JointConstSharedPtr> up;
  for (urdf::LinkConstSharedPtr link = model->getLink(tip); link->name != base; link = link->getParent())
    up.push_back(link->parent_joint);
  KDL::Chain chain;
  for (auto joint = up.rbegin(); joint != up.rend(); ++joint) {
    const urdf::Pose& o = (*joint)->parent_to_joint_origin_transform;
    const urdf::Vector3& a = (*joint)->axis;
    drawn::add_joint(chain,
                     {KDL::Rotation::Quaternion(o.rotation.x, o.rotation.y, o.rotation.z, o.rotation.w),
                      KDL::Vector(o.position.x, o.position.y, o.position.z)},
                     (*joint)->type != urdf::Joint::FIXED, {a.x, a.y, a.z});
  }
  return drawn::Judge(chain);
}

double apart(const Pose<double>& a, const Pose<double>& b) {
  return (a.position - b.position).norm() + (a.rotation - b.rotation).norm();
}

/// Every geometric term there is, base and tool included, of the size of a calibration's.
Calibration some_errors(arms::Random& random) {
  Calibration set;
  const auto add = [&](std::uint8_t body, std::uint8_t slot, double size) {
    Term<double> t;
    t.place = {body, slot};
    t.coefficient = random.around(size);
    set.terms.terms.push_back(t);
  };
  for (std::uint8_t link = 1; link <= 6; ++link) {
    for (std::uint8_t s = 0; s < 5; ++s) add(link, s, s == slot::d || s == slot::a ? 1e-3 : 5e-3);
  }
  for (std::uint8_t s = 0; s < 6; ++s) {
    add(body::base, s, s < 3 ? 5e-3 : 1e-2);
    add(body::tool, s, s < 3 ? 2e-3 : 1e-2);
  }
  return set;
}

/// L and R of URDF = L · ours · R for the nominal arm; then the calibrated ones must obey the same.
double worst(const std::string& path, const UrdfLinks& links, const Robot& robot, const Calibration& set,
             const CorrectedUrdf& out, int poses, std::uint64_t seed) {
  const UrdfArm arm = load_urdf(path, links);
  auto drawn = judge_of(support::read(path), arm.base, arm.tip);
  auto exported = judge_of(out.text, arm.base, out.tip);
  const MovingArm nominal(robot);
  const MovingArm model(robot, set.terms);
  // With two poses of the nominal arm L and R are known up to what commutes; take L from the import, whose frames the
  // tests of the import judge, where the robot file is an imported one.
  const ImportedArm imported = import_urdf(path, links);
  const Pose<double> left = imported.base_to_f0;
  const Pose<double> right = inverse(left * nominal(arms::Joints{})) * drawn(arms::Joints{});
  arms::Random random(seed);
  double most = 0;
  for (int k = 0; k < poses; ++k) {
    const arms::Joints q = random.joints(3.1);
    EXPECT_LT(apart(left * nominal(q) * right, drawn(q)), 2e-8) << "the nominal arms differ";
    most = std::max(most, apart(left * model(q) * right, exported(q)));
  }
  return most;
}

TEST(CorrectedUrdf, ItsTipGoesWhereTheRigidModelGoes) {
  arms::Random random(4);
  for (const char* name : {"kuka_kr6_r900", "abb_irb120", "tx60l", "ur5"}) {
    const std::string path = data + name + ".urdf";
    const Robot robot = import_urdf(path, {}).robot;
    for (std::uint64_t n = 0; n < 5; ++n) {
      const Calibration set = some_errors(random);
      const CorrectedUrdf out = correct_urdf(path, {}, robot, set);
      const double most = worst(path, {}, robot, set, out, 200, n);
      std::printf("%s: %.1e m and rad\n", name, most);
      EXPECT_LT(most, 1e-9) << name;
      EXPECT_GE(out.joints.size(), 7U);
    }
  }
}

// The project's own robot files have other frames F0 and Ftool than the URDFs; the axes are what counts. An arm's own file
// with a tool of 60 mm: the tip of the URDF stays the flange, corrected.
TEST(CorrectedUrdf, OfRobotFilesWithFramesOfTheirOwn) {
  arms::Random random(5);
  for (const auto& [file, urdf] :
       {std::pair{"tx60l", "tx60l.urdf"}, std::pair{"kuka-kr6-r900", "kuka_kr6_r900.urdf"},
        std::pair{"abb-irb120", "abb_irb120.urdf"}, std::pair{"ur5", "ur5.urdf"}}) {
    const Robot robot = support::robot(file);
    Calibration set = some_errors(random);
    // The tool of the robot file is not in the URDF: its terms would turn about another point.
    std::erase_if(set.terms.terms, [](const Term<double>& t) { return t.place.body == body::tool; });
    const CorrectedUrdf out = correct_urdf(data + urdf, {}, robot, set);
    const UrdfArm arm = load_urdf(data + urdf, {});
    auto drawn = judge_of(support::read(data + urdf), arm.base, arm.tip);
    auto exported = judge_of(out.text, arm.base, out.tip);
    const MovingArm nominal(robot);
    const MovingArm model(robot, set.terms);
    // exported(q) = L · ours(q) · R with the L and R of the nominal arms, whatever they are:
    // drawn(p)^-1 drawn(q) = R^-1 n(p)^-1 n(q) R holds for the nominal pair; R from two frames at p = q:
    // eliminate both by comparing differences between calibrated and nominal motion in the base.
    // L: n(q) and drawn(q) give L n(q) R = drawn(q); from joint 1's axis and rotations between random poses:
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    const arms::Joints zero{};
    const Pose<double> n0 = nominal(zero);
    for (int k = 0; k < 50; ++k) {
      const arms::Joints q = random.joints(1);
      // drawn(q) drawn(0)^-1 = L n(q) n(0)^-1 L^-1: the axes of these turns are carried by L.
      const Eigen::AngleAxisd a(Eigen::Matrix3d(drawn(q).rotation * drawn(zero).rotation.transpose()));
      const Eigen::AngleAxisd b(Eigen::Matrix3d(nominal(q).rotation * n0.rotation.transpose()));
      sum += a.axis() * b.axis().transpose();
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Pose<double> left;
    left.rotation = svd.matrixU() * svd.matrixV().transpose();
    if (left.rotation.determinant() < 0) {
      left.rotation = svd.matrixU() * Eigen::Vector3d(1, 1, -1).asDiagonal() * svd.matrixV().transpose();
    }
    // (turn - 1) t_L = what the translations of these motions leave.
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right_side = Eigen::Vector3d::Zero();
    for (int k = 0; k < 50; ++k) {
      const arms::Joints q = random.joints(2);
      const Pose<double> motion = nominal(q) * inverse(n0);
      const Pose<double> theirs = drawn(q) * inverse(drawn(zero));
      const Eigen::Matrix3d a = theirs.rotation - Eigen::Matrix3d::Identity();
      const Eigen::Vector3d b = left.rotation * motion.position - theirs.position;
      normal += a.transpose() * a;
      right_side += a.transpose() * b;
    }
    left.position = normal.ldlt().solve(right_side);
    const Pose<double> right = inverse(left * n0) * drawn(zero);
    double most = 0;
    double least = 1;
    for (int k = 0; k < 200; ++k) {
      const arms::Joints q = random.joints(3.1);
      const Pose<double> ours = left * model(q) * right;
      most = std::max(most, apart(ours, exported(q)));
      least = std::min(least, apart(ours, drawn(q)));
    }
    std::printf("%s: %.1e m and rad\n", file, most);
    // The judge's own L and R carry the rounding of the URDF's right angles (2e-9 rad on the UR5).
    EXPECT_LT(most, std::string(urdf) == "ur5.urdf" ? 5e-8 : 1e-9) << file;
    EXPECT_GT(least, 1e-4) << "the test would not see a correction";
  }
}

TEST(CorrectedUrdf, NothingElseChanges) {
  const std::string path = data + "kuka_kr6_r900.urdf";
  const Robot robot = import_urdf(path, {}).robot;
  const std::string before = support::read(path);
  EXPECT_EQ(correct_urdf(path, {}, robot, Calibration()).text, before);

  Calibration set;
  Term<double> t;
  t.place = {2, slot::a};
  t.coefficient = 1e-3;
  set.terms.terms.push_back(t);
  const CorrectedUrdf out = correct_urdf(path, {}, robot, set);
  ASSERT_EQ(out.joints.size(), 1U);
  EXPECT_EQ(out.joints[0].name, "joint_a3");
  EXPECT_NEAR(out.joints[0].moved_m, 1e-3, 1e-12);
  EXPECT_EQ(out.text, replaced(before, "0.455 0 0", "0.456 0 0"));

  // With comments that look like joints, other quotes, line ends, entities, meshes and transmissions.
  std::string strange = before;
  strange =
      replaced(strange, "<joint name=\"joint_a3\"",
               "<!-- <joint name=\"joint_a3\"><origin xyz=\"9 9 9\"/></joint> -->\r\n"
               "<transmission name='t'><joint name='joint_a3'><origin xyz='8 8 8'/></joint></transmission>"
               "<joint\tname = 'joint_a3'  ");
  strange = replaced(strange, "<origin xyz=\"0.455 0 0\" rpy=\"0 0 0\"/>",
                     "<origin\n  rpy='0 0 0' xyz = '0.455 0 0' />");
  const std::string odd = support::write("odd.urdf", strange);
  EXPECT_EQ(correct_urdf(odd, {}, robot, set).text, replaced(strange, "'0.455 0 0'", "'0.456 0 0'"));
  // No rpy, and no origin at all.
  const std::string bare =
      replaced(before, "<origin xyz=\"0.455 0 0\" rpy=\"0 0 0\"/>", "<origin xyz=\"0.455 0 0\"/>");
  EXPECT_THAT(correct_urdf(support::write("bare.urdf", bare), {}, robot, set).text,
              testing::HasSubstr("<origin rpy=\"0 0 0\" xyz=\"0.456 0 0\"/>"));
}

TEST(CorrectedUrdf, AnOriginThatWasNotThereIsAdded) {
  drawn::Arm arm = drawn::abb_irb120();
  std::string text = drawn::urdf(arm);
  const Robot robot = import_urdf(support::write("abb.urdf", text), {}).robot;
  text =
      replaced(text, "<origin xyz=\"0 0 0\" rpy=\"0 0 0\"/>\n<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 0 1\"/>");
  const std::string path = support::write("no_origin.urdf", text);
  arms::Random random(6);
  const Calibration set = some_errors(random);
  EXPECT_LT(worst(path, {}, robot, set, correct_urdf(path, {}, robot, set), 100, 1), 1e-9);
}

// A tip that hangs on joint 6 itself, joints with fixed ones between them, and a base that is not the root.
TEST(CorrectedUrdf, WhereverTheFixedJointsAre) {
  arms::Random random(7);
  for (int n = 0; n < 40; ++n) {
    drawn::Arm arm = drawn::kuka_kr6_r900();
    if (n % 2 == 0) arm.pop_back();
    const std::size_t fixed = random.below(4);
    for (std::size_t k = 0; k < fixed; ++k) {
      drawn::Joint joint;
      for (double& v : joint.xyz_m) v = random.around(0.3);
      for (double& v : joint.rpy_rad) v = random.around(3);
      arm.insert(arm.begin() + static_cast<std::ptrdiff_t>(random.below(arm.size() + 1)), joint);
    }
    const std::string path = support::write("fixed" + std::to_string(n) + ".urdf", drawn::urdf(arm));
    const std::string base = arm[0].is_fixed() && n % 3 == 0 ? "l1" : "";
    const UrdfLinks links{base, "", ""};
    const Robot robot = import_urdf(path, links).robot;
    const Calibration set = some_errors(random);
    const CorrectedUrdf out = correct_urdf(path, links, robot, set);
    EXPECT_EQ(out.added_tip, !arm.back().is_fixed());
    EXPECT_LT(worst(path, links, robot, set, out, 50, static_cast<std::uint64_t>(n)), 1e-9) << n;
  }
}

TEST(CorrectedUrdf, AnotherArmIsRefusedByItsJoint) {
  const std::string path = data + "kuka_kr6_r900.urdf";
  Robot robot = import_urdf(path, {}).robot;
  robot.nominal.links[2].a_m += 2e-3;
  for (const std::string& urdf : {path, data + "abb_irb120.urdf"}) {
    try {
      correct_urdf(urdf, {}, robot, {});
      ADD_FAILURE() << urdf;
    } catch (const InputError& e) {
      EXPECT_EQ(e.file(), urdf);
      EXPECT_THAT(e.field(), testing::StartsWith("joint '"));
      EXPECT_THAT(e.found(),
                  testing::AllOf(testing::HasSubstr(" mm and "), testing::HasSubstr("another arm")));
    }
  }
}

/// Rot(z,yaw) Rot(y,pitch) Rot(x,roll)
Eigen::Matrix3d rotation_by(const Eigen::Vector3d& rpy) {
  return (Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

TEST(RollPitchYaw, AlsoWherePitchIsARightAngle) {
  arms::Random random(8);
  for (int n = 0; n < 20000; ++n) {
    const double near = n % 3 == 0   ? flexcomp::host::pi / 2 + random.around(n % 2 == 0 ? 1e-9 : 1e-6)
                        : n % 3 == 1 ? random.around(3.2)
                                     : -flexcomp::host::pi / 2;
    const Eigen::Matrix3d r = rotation_by({random.around(3.2), near, random.around(3.2)});
    const Eigen::Matrix3d back = rotation_by(roll_pitch_yaw(r));
    ASSERT_LT((back - r).norm(), 1e-14) << n;
  }
}

// What a URDF cannot hold is the difference to the whole model, nothing more and nothing less.
TEST(LeftOutByRigid, IsWhatTheFlexibleModelAdds) {
  const Robot& robot = support::tx60l();
  const Calibration truth = load_calibration(data + "tx60l_table1.yaml", robot);
  const LeftOut left = left_out_by_rigid(truth, robot, 500);
  EXPECT_EQ(left.effects.size(), 7U);
  double sum = 0;
  double largest = 0;
  for (const LeftOut::Effect& e : left.effects) {
    sum += e.largest_m;
    largest = std::max(largest, e.largest_m);
  }
  EXPECT_LE(left.largest_m, sum);
  EXPECT_GT(left.largest_m, 0.5 * largest);
  // At one pose by hand: all with payload, as at a random pose of the sample, is within the bound.
  const MovingArm whole(robot, truth.terms);
  const MovingArm rigid(robot, rigid_part(truth.terms));
  const arms::Joints stretched{0, 1.5, 0, 0, 0, 0};
  const double there = (whole(stretched).position - rigid(stretched).position).norm();
  EXPECT_GT(there, 0.5 * left.largest_m) << "a stretched arm bends most";
  EXPECT_LT(there, 1.2 * left.largest_m);
  Calibration stiff;
  stiff.terms = rigid_part(truth.terms);
  EXPECT_TRUE(left_out_by_rigid(stiff, robot, 10).effects.empty());
}

}  // namespace
