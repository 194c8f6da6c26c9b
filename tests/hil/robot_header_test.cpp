// SPDX-License-Identifier: Apache-2.0
// The nominal robot on its way into a controller: what `flexcomp export` writes reads back to the very doubles of the
// robot file, so that both sides have the same nominal hash.
#include "exchange/robot_header.hpp"

#include <gmock/gmock.h>

#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "../../firmware/examples/tx60l.h"
#include "files/robot_file.hpp"

namespace flexcomp::host {
namespace {

Robot robot_file(const std::string& name) {
  return load_robot(std::string(FLEXCOMP_SOURCE_DIR) + "/host/robots/" + name + ".yaml");
}

/// All numbers of the robot in the order of flexcomp_robot.
std::vector<double> numbers(const NominalRobot<joint_count>& r) {
  std::vector<double> v;
  for (const NominalLink& l : r.links)
    v.insert(v.end(), {l.theta_rad, l.d_m, l.a_m, l.alpha_rad, l.beta_rad});
  for (const JointLimits& l : r.limits) v.push_back(l.min_rad);
  for (const JointLimits& l : r.limits) v.push_back(l.max_rad);
  v.insert(v.end(), r.gravity_m_s2.begin(), r.gravity_m_s2.end());
  v.insert(v.end(), r.tool_xyz_m.begin(), r.tool_xyz_m.end());
  v.insert(v.end(), r.tool_wxyz.begin(), r.tool_wxyz.end());
  v.push_back(r.payload_kg);
  v.insert(v.end(), r.payload_com_m.begin(), r.payload_com_m.end());
  v.push_back(r.reference_temperature_c);
  return v;
}

bool same_bits(const std::vector<double>& a, const double* b) {
  return std::memcmp(a.data(), b, a.size() * sizeof(double)) == 0;
}

TEST(RobotHeader, InTheRepositoryIsTheRobotFileToTheLastBit) {
  const Robot file = robot_file("tx60l");
  const std::vector<double> expected = numbers(file.nominal);
  ASSERT_EQ(offsetof(flexcomp_robot, serial),
            offsetof(flexcomp_robot, links) + expected.size() * sizeof(double));
  EXPECT_EQ(staubli_tx60l.serial, nullptr);
  EXPECT_TRUE(same_bits(expected, &staubli_tx60l.links[0].theta_rad));
  EXPECT_EQ(file.name, staubli_tx60l.name);

  NominalRobot<joint_count> of_the_header;
  for (std::size_t j = 0; j < joint_count; ++j) {
    const flexcomp_link& l = staubli_tx60l.links[j];
    of_the_header.links[j] = {l.theta_rad, l.d_m, l.a_m, l.alpha_rad, l.beta_rad};
  }
  EXPECT_EQ(nominal_hash(of_the_header), nominal_hash(file.nominal));
}

TEST(RobotHeader, NumbersReadBackToTheSameBits) {
  for (const char* name : {"tx60l", "rx160l", "ur10", "ur5"}) {
    Robot file = robot_file(name);
    file.nominal.links[1].beta_rad = -0.0;  // signs, subnormals and all digits survive
    file.nominal.links[2].d_m = 1.0 / 3;
    file.nominal.payload_kg = 4.9e-324;
    file.nominal.gravity_m_s2[0] = 1e22;
    std::string text = robot_header(file);
    const std::string literal = '"' + file.name + '"';
    text.erase(0, text.find(literal) + literal.size());
    std::vector<double> read;
    for (const char* p = text.c_str(); *p != 0;) {
      char* end = nullptr;
      const double v = std::strtod(p, &end);
      if (end != p) read.push_back(v);
      p = end != p ? end : p + 1;
    }
    const std::vector<double> expected = numbers(file.nominal);
    ASSERT_EQ(read.size(), expected.size()) << text;
    EXPECT_TRUE(same_bits(expected, read.data())) << text;
  }
}

TEST(RobotHeader, NamesBecomeIdentifiersAndLiterals) {
  EXPECT_THAT(robot_header(robot_file("ur5")), testing::HasSubstr("\n    NULL,\n};"));
  Robot unit = robot_file("ur5");
  set_serial(unit, "A \"1\"\x01 ä");
  EXPECT_THAT(robot_header(unit), testing::HasSubstr("\n    \"A \\\"1\\\"\\001 \\303\\244\",\n};"));
  EXPECT_EQ(c_identifier("staubli-tx60l"), "staubli_tx60l");
  EXPECT_EQ(c_identifier("6-axis"), "robot_6_axis");
  EXPECT_EQ(c_identifier("_arm"), "robot__arm");
  EXPECT_EQ(c_identifier("double"), "robot_double");
  EXPECT_EQ(c_identifier("Stäubli"), "St__ubli");
  Robot file = robot_file("ur5");
  file.name = "a \"b\" \\ ?\?= ä9";
  EXPECT_THAT(robot_header(file), testing::HasSubstr(R"("a \"b\" \\ \?\?= \303\2449")"));
}

}  // namespace
}  // namespace flexcomp::host
