// SPDX-License-Identifier: Apache-2.0
// Files come from anywhere: whatever is changed in a good one, it is read or refused by InputError; nothing else is
// thrown, nothing crashes.
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "model/parameter_image.hpp"
#include "support/mutation.hpp"
#include "support/robot_files.hpp"
#include "support/text_file.hpp"

namespace {

using namespace flexcomp::host;

constexpr int rounds = 1500;

void read_mutations(const std::string& good, const std::function<void(const std::string& path)>& read) {
  const int refused =
      support::refused_mutations(good, {rounds, "0123456789.-+e,:[]{}\"'#&*!|>%@~ \n\r\t\\_abnxyz\xEF"},
                                 [&](const std::string& text) { read(support::write("mutation", text)); });
  EXPECT_GT(refused, rounds / 10);
  EXPECT_LT(refused, rounds);
}

TEST(Mutations, OfARobotFile) {
  read_mutations(support::read(support::robots + "tx60l.yaml"),
                 [](const std::string& path) { load_robot(path); });
}

TEST(Mutations, OfACalibration) {
  const Robot& robot = support::tx60l();
  const std::string good =
      support::read(support::data + "tx60l_table1.yaml") +
      "  - {effect: joint_curve, joint: 1, coefficients_rad: [0, 1.0e-4, 0, -1.0e-4, 0, 0]}\n"
      "  - {effect: unnamed, place: link3.theta, of: [q2, payload_kg], grid: [[-30, 30], [0, 5]], "
      "values_rad: [[0, 1], [2, "
      "0]]}\n"
      "  - {effect: thermal_growth, link: 4, per_k: 1.0e-6}\n"
      "frames: {f: {xyz_mm: [1, 2, 3], quaternion_wxyz: [1, 0, 0, 0]}, e: {xyz_mm: [1, 2, 3]}}\n";
  // What is read can also be written and made into an image, or is refused there in the same way.
  read_mutations(good, [&](const std::string& path) {
    const Calibration c = load_calibration(path, robot);
    calibration_text(c, robot);
    make_image(c, robot, 1, {.allow_unnamed = true});
  });
}

TEST(Mutations, OfADataFile) {
  const Robot& robot = support::tx60l();
  const std::string good =
      "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,qw,qx,qy,qz,payload_kg,move1_deg,dir2\n"
      "10,20,30,40,50,60,100.5,-200,1e2,1,0,0,0,1.108,5,-1\n"
      "-10,20,30,-40,50,60,100.5,-200,1e2,0.5,0.5,0.5,0.5,1.108,-5,0\n"
      "10,-20,30,40,50,160,100.5,-200,1e2,0,0,1,0,0,15,1\n";
  read_mutations(good, [&](const std::string& path) { data_text(load_data(path, robot)); });
  read_mutations(good, [&](const std::string& path) { load_targets(path, robot); });
}

}  // namespace
