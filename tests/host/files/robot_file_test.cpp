// SPDX-License-Identifier: Apache-2.0
#include "files/robot_file.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <random>

#include "model/calibration.hpp"
#include "support/robot_files.hpp"
#include "support/text_file.hpp"
#include "units.hpp"

namespace robot_files {

using namespace flexcomp::host;
using support::expect_refused;
using support::replaced;
using support::robots;

// Line 1 is the name, line 3 joint 1 … line 8 joint 6.
const std::string good =
    "name: arm\n"
    "joints:\n"
    "  - {theta_deg: 0, d_mm: 0, a_mm: 0, alpha_deg: -90, beta_deg: 0, min_deg: -180, max_deg: 180}\n"
    "  - {theta_deg: -90, d_mm: 0, a_mm: 400, alpha_deg: 0, min_deg: -127.5, max_deg: 127.5, "
    "max_speed_deg_s: 385}\n"
    "  - {theta_deg: 90, d_mm: 20, a_mm: 0, alpha_deg: 90, min_deg: -142.5, max_deg: 142.5, gear_ratio: "
    "101}\n"
    "  - {theta_deg: 0, d_mm: 450, a_mm: 0, alpha_deg: -90, min_deg: -270, max_deg: 270}\n"
    "  - {theta_deg: 0, d_mm: 0, a_mm: 0, alpha_deg: 90, min_deg: -122.5, max_deg: 133.5}\n"
    "  - {theta_deg: 0, d_mm: 70, a_mm: 0, alpha_deg: 0, min_deg: -270, max_deg: 270}\n";

Robot load(const std::string& text) { return load_robot(support::write("robot.yaml", text)); }

void refused(const std::string& text, std::size_t line, const std::string& field,
             const std::vector<std::string>& parts = {}) {
  expect_refused([&] { load(text); }, line, field, parts);
}

TEST(Robot, ReadsTheContractsExample) {
  const Robot& r = support::tx60l();
  EXPECT_EQ(r.name, "staubli-tx60l");
  EXPECT_EQ(r.nominal.links[1].a_m, 0.4);
  EXPECT_EQ(r.nominal.links[5].d_m, 0.07);  // the nearest double, not 70 times the double 0.001
  EXPECT_EQ(r.nominal.links[0].alpha_rad, -pi / 2);
  EXPECT_EQ(r.nominal.limits[4].max_rad, radians(133.5));
  EXPECT_EQ(r.nominal.tool_xyz_m, (std::array<double, 3>{0.01, 0.03, 0.06}));
  EXPECT_EQ(r.nominal.payload_kg, 1.108);
  EXPECT_EQ(r.nominal.payload_com_m, (std::array<double, 3>{0.005, 0.008, 0.06}));
  ASSERT_EQ(r.reflectors_m.size(), 4U);
  EXPECT_EQ(r.reflectors_m[3], Eigen::Vector3d(0.075, 0, 0));
  EXPECT_TRUE(r.has_noise);
  EXPECT_DOUBLE_EQ(r.position_sigma_m, 0.035e-3);
  EXPECT_DOUBLE_EQ(r.orientation_sigma_rad, radians(0.007));
  EXPECT_EQ(r.capsules.size(), 3U);
  EXPECT_DOUBLE_EQ(r.max_speed_rad_s[0], radians(435));
}

TEST(Robot, EveryRobotOfTheProjectLoads) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(robots)) {
    EXPECT_NO_THROW(load_robot(entry.path().string())) << entry.path();
    ++count;
  }
  EXPECT_GE(count, 6U);
}

TEST(Robot, NameAndJointsAreEnough) {
  const Robot r = load(good);
  EXPECT_FALSE(r.has_noise);
  EXPECT_EQ(r.gear_ratio[2], 101);
  EXPECT_EQ(r.gear_ratio[1], 0);
  EXPECT_EQ(r.nominal.reference_temperature_c, 20);
  EXPECT_TRUE(r.reflectors_m.empty());
}

TEST(Robot, SerialNamesTheUnitAndNotTheArm) {
  const Robot without = load(good);
  EXPECT_EQ(without.serial, "");
  EXPECT_EQ(without.nominal.unit_hash, flexcomp::Sha256Digest{});
  const auto of = [](const std::string& serial) { return load(good + "serial: " + serial + "\n"); };
  // printf 'A-4711 ä' | sha256sum
  const Robot robot = of("'A-4711 ä'");
  EXPECT_EQ(robot.serial, "A-4711 ä");
  EXPECT_EQ(hex(robot.nominal.unit_hash), "cbf88eeba2f5a065dde136c652b1b6a3dd800d4dbb743d766f6627751eaf8159");
  EXPECT_EQ(nominal_hash(robot.nominal), nominal_hash(without.nominal));
  EXPECT_EQ(of("00471").serial, "00471");
  EXPECT_EQ(of("'\"\\ #: '").serial, "\"\\ #: ");
  EXPECT_NO_THROW(of(std::string(44, 'x')));
  for (const Robot& r : {without, robot, of("'\"\\ #: '"), of("'# x'")}) {
    const Robot again = parse_robot(robot_text(r, {}), "again");
    EXPECT_EQ(again.serial, r.serial);
    EXPECT_EQ(again.nominal.unit_hash, r.nominal.unit_hash);
  }
  for (const std::string& bad :
       {std::string(45, 'x'), std::string("\"a\\nb\""), std::string("\"\\x1b[31m\""),
        std::string("\"\\x7f\""), std::string("\"a\\u0085\""), std::string("\"a\\0\""),
        std::string("'") + "é" + std::string(43, 'x') + "'"}) {
    refused(good + "serial: " + bad + "\n", 9, "serial", {"1 to 44 bytes of UTF-8"});
  }
  for (const char* bad : {"''", "~", "[a]", "{a: b}"}) refused(good + "serial: " + bad + "\n", 9, "serial");
  refused(good + "serial: a\nserial: b\n", 10, "serial");
  EXPECT_THROW(of("\xff\xfe"), InputError);
  EXPECT_THROW(of("'a\xc3'"), InputError);
}

TEST(Robot, MessageNamesFileLineFieldFoundAndExpected) {
  try {
    load(replaced(good, "a_mm: 400", "a_mm: abc"));
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(std::string(e.what()),
              support::path_of("robot.yaml") + ":4: joints[2].a_mm: expected a finite number, found 'abc'");
  }
}

TEST(Robot, RefusesWhatIsNotFinite) {
  for (const char* text :
       {".nan", "nan", ".inf", "inf", "1e999", "0x10", "1;5", "4OO", "\"\"", "[1]", "~", "--1", "+-1"}) {
    refused(replaced(good, "a_mm: 400", std::string("a_mm: ") + text), 4, "joints[2].a_mm",
            {"finite number"});
  }
}

TEST(Robot, RefusesUnknownKeysWithTheNearest) {
  refused(replaced(good, "a_mm: 400", "a: 400"), 4, "joints[2].a", {"did you mean 'a_mm'"});
  refused(replaced(good, "name:", "nmae:"), 1, "nmae", {"did you mean 'name'"});
  refused(good + "gravitiy_m_s2: [0, 0, -9.8]\n", 9, "gravitiy_m_s2", {"did you mean 'gravity_m_s2'"});
  refused(good + "tool: {xyz_mm: [0, 0, 0], rpy_deg: [0, 0, 0]}\n", 9, "tool.rpy_deg", {"unknown key"});
  refused(good + "colour: red\n", 9, "colour", {"one of the keys name, joints"});
}

TEST(Robot, RefusesWhatIsMissingOrTwice) {
  refused(replaced(good, "name: arm\n", ""), 1, "name", {"expected this key"});
  refused(replaced(good, "a_mm: 400, ", ""), 4, "joints[2].a_mm");
  refused(replaced(good, "d_mm: 20,", "d_mm: 20, d_mm: 21,"), 5, "joints[3].d_mm", {"a second time"});
  refused(good + "name: other\n", 9, "name", {"a second time"});
}

TEST(Robot, RefusesOtherThanSixJoints) {
  refused(good.substr(0, good.rfind("  - ")), 2, "joints", {"exactly six", "a list of 5"});
  refused(good + good.substr(good.rfind("  - ")), 2, "joints", {"a list of 7"});
  refused("name: x\njoints: 6\n", 2, "joints", {"a list"});
}

TEST(Robot, RefusesEmptyRanges) {
  refused(replaced(good, "max_deg: 142.5", "max_deg: -142.5"), 5, "joints[3].max_deg",
          {"more than min_deg (-142.5)"});
}

TEST(Robot, QuaternionsAreNormalisedWithinAThousandth) {
  const auto with = [](const std::string& q) { return good + "tool: {quaternion_wxyz: " + q + "}\n"; };
  const Robot r = load(with("[-1.0005, 0, 0, 0]"));
  EXPECT_EQ(r.nominal.tool_wxyz, (std::array<double, 4>{1, 0, 0, 0}));
  refused(with("[1.002, 0, 0, 0]"), 9, "tool.quaternion_wxyz", {"norm 1.002"});
  refused(with("[0, 0, 0, 0]"), 9, "tool.quaternion_wxyz");
  refused(with("[1, 0, 0]"), 9, "tool.quaternion_wxyz", {"four numbers"});
}

TEST(Robot, RefusesLengthsOfNoArm) {
  for (const char* key : {"a_mm: 400", "d_mm: 450"}) {
    const std::string name = std::string(key).substr(0, 4);
    const std::size_t joint = name == "a_mm" ? 2 : 4;
    const std::string field = "joints[" + std::to_string(joint) + "]." + name;
    EXPECT_NO_THROW(load(replaced(good, key, name + ": -20000")));
    refused(replaced(good, key, name + ": -20001"), joint + 2, field, {"20000 mm", "nearly parallel"});
  }
}

TEST(Robot, RefusesImpossibleValues) {
  refused(good + "payload: {mass_kg: -1}\n", 9, "payload.mass_kg", {"0 or more"});
  refused(good + "noise: {position_mm: 0}\n", 9, "noise.position_mm", {"above 0"});
  refused(good + "tool:\n  reflectors_mm: {a: [0, 0, 0], b: [1, 0, 0]}\n", 10, "tool.reflectors_mm.c");
  refused(good + "capsules:\n  - {frame: 7, from_mm: [0,0,0], to_mm: [0,0,1], radius_mm: 1}\n", 10,
          "capsules[1].frame", {"from 0 to 6"});
  refused(good + "gravity_m_s2: [0, 0, -9800]\n", 9, "gravity_m_s2");
}

TEST(Robot, RefusesWhatIsNoYaml) {
  expect_refused([] { load_robot(support::path_of("absent.yaml")); }, 0, "", {"absent.yaml", "can be read"});
  refused("name: [\n", 2, "");
  refused("", 0, "", {"mapping"});
  refused("- 1\n", 0, "", {"mapping"});
}

TEST(Units, TextAndSiAreInverse) {
  std::mt19937_64 random(7);
  std::uniform_int_distribution<std::uint64_t> bits;
  std::uniform_real_distribution<double> usual(-10, 10);
  for (const Unit& u : {unit::si, unit::mm, unit::degree, unit::mm_per_hour, unit::degree_per_hour}) {
    for (int k = 0; k < 20000; ++k) {
      double v = usual(random);
      if (k % 2 == 0) {
        v = flexcomp::double_of(bits(random));
        // Beyond, a factor of 1000 could overflow or lose digits of a subnormal.
        if (!(std::abs(v) < 1e290 && std::abs(v) > 1e-290)) continue;
      }
      const std::string text = format_si(v, u);
      ASSERT_EQ(parse_si(text, u), v) << text << " " << u.name;
    }
  }
}

TEST(Units, ShortNumbersStayShort) {
  EXPECT_EQ(format_si(0.07, unit::mm), "70");
  EXPECT_EQ(format_si(radians(-127.5), unit::degree), "-127.5");
  EXPECT_EQ(format_si(0.1, unit::si), "0.1");
  EXPECT_EQ(format_si(-0.0, unit::mm), "-0");
}

}  // namespace robot_files
