// SPDX-License-Identifier: Apache-2.0
#include "files/cell_file.hpp"

#include <gtest/gtest.h>

#include "planning/feasibility.hpp"
#include "support/robot_files.hpp"
#include "support/text_file.hpp"

namespace cell_files {

using namespace flexcomp::host;
using support::expect_refused;

const std::string example = FLEXCOMP_SOURCE_DIR "/docs/examples/cell.yaml";

Cell load(const std::string& text) { return load_cell(support::write("cell.yaml", text)); }

void refused(const std::string& text, std::size_t line, const std::string& field,
             const std::vector<std::string>& parts = {}) {
  expect_refused([&] { load(text); }, line, field, parts);
}

TEST(CellFile, ReadsTheDocumentedExample) {
  const Cell cell = load_cell(example);
  EXPECT_EQ(cell.path, example);
  ASSERT_TRUE(cell.tracker_m);
  EXPECT_EQ(*cell.tracker_m, Eigen::Vector3d(2.5, -0.4, 0.3));
  ASSERT_EQ(cell.obstacles.size(), 3U);
  EXPECT_EQ(cell.obstacles[0].frame, 0U);
  EXPECT_EQ(cell.obstacles[0].from_m, Eigen::Vector3d(0.7, 0.7, -1));
  EXPECT_EQ(cell.obstacles[0].to_m, Eigen::Vector3d(0.7, 0.7, 0.5));
  EXPECT_EQ(cell.obstacles[0].radius_m, 0.06);
  EXPECT_EQ(cell.safety, 3);
  EXPECT_EQ(cell.smr_radius_m, 0.01905);
  EXPECT_EQ(cell.acceptance_rad, pi / 2);
}

TEST(CellFile, TheExampleLeavesRoomForEveryRobotOfTheProject) {
  for (const char* name : {"tx60l", "rx160l", "ur5", "ur10"}) {
    const Robot robot = support::robot(name);
    const Feasibility feasibility(robot, load_cell(example));
    EXPECT_EQ(feasible_poses(feasibility, robot, 100, 1).size(), 100U) << name;
  }
}

TEST(CellFile, TheExamplesFloorIsFlat) {
  const Capsule floor = load_cell(example).obstacles[2];
  for (const double y : {0.0, 1.0, 2.0}) {
    const double top = -std::sqrt(squared_distance(Eigen::Vector3d(0.5, y, 0), {floor.from_m, floor.to_m}));
    EXPECT_NEAR(top + floor.radius_m, -1, 0.0021) << y;
  }
}

TEST(CellFile, EverythingHasADefault) {
  const Cell cell = load("safety: 2.5\n");
  EXPECT_FALSE(cell.tracker_m);
  EXPECT_TRUE(cell.obstacles.empty());
  EXPECT_EQ(cell.safety, 2.5);
  EXPECT_EQ(cell.smr_radius_m, 0.01905);
  EXPECT_EQ(cell.acceptance_rad, pi / 2);
  EXPECT_EQ(load("obstacles: []\n").safety, 3);
  EXPECT_EQ(load("acceptance_deg: 180\n").acceptance_rad, pi);
  EXPECT_EQ(load("safety: 0\n").safety, 0);
}

TEST(CellFile, RefusesUnknownKeysByName) {
  refused("tracker_m: [1, 2, 3]\n", 1, "tracker_m", {"did you mean 'tracker_mm'", "cell.yaml:1"});
  refused("safety: 3\nobstacle: []\n", 2, "obstacle", {"did you mean 'obstacles'"});
  refused("safety: 3\ncolour: red\n", 2, "colour", {"tracker_mm, obstacles, safety"});
  refused("safety: 3\nsafety: 2\n", 2, "safety", {"a second time"});
  refused("obstacles:\n  - {from_mm: [0,0,0], to_mm: [0,0,1], radius_mm: 1, raduis_mm: 2}\n", 2,
          "obstacles[1].raduis_mm", {"did you mean 'radius_mm'"});
}

TEST(CellFile, RefusesImpossibleValues) {
  refused("tracker_mm: [1, 2]\n", 1, "tracker_mm", {"three numbers"});
  refused("tracker_mm: [1, 2, far]\n", 1, "tracker_mm[3]", {"finite number", "'far'"});
  refused("safety: -1\n", 1, "safety", {"0 or more", "'-1'"});
  refused("safety: nan\n", 1, "safety", {"finite"});
  refused("smr_radius_mm: 0\n", 1, "smr_radius_mm", {"above 0"});
  refused("acceptance_deg: 0\n", 1, "acceptance_deg", {"above 0 and at most 180"});
  refused("acceptance_deg: 181\n", 1, "acceptance_deg", {"above 0 and at most 180"});
  refused("obstacles: 3\n", 1, "obstacles", {"a list"});
  refused("obstacles:\n  - {from_mm: [0,0,0], radius_mm: 1}\n", 2, "obstacles[1].to_mm", {"this key"});
  refused("obstacles:\n  - {from_mm: [0,0,0], to_mm: [0,0,1], radius_mm: -1}\n", 2, "obstacles[1].radius_mm",
          {"above 0"});
}

TEST(CellFile, ObstaclesStandStill) {
  EXPECT_EQ(
      load("obstacles:\n  - {frame: 0, from_mm: [0,0,0], to_mm: [0,0,1], radius_mm: 1}\n").obstacles.size(),
      1U);
  refused("obstacles:\n  - {frame: 3, from_mm: [0,0,0], to_mm: [0,0,1], radius_mm: 1}\n", 2,
          "obstacles[1].frame", {"stands still", "'3'"});
  refused("obstacles:\n  - {frame: F0, from_mm: [0,0,0], to_mm: [0,0,1], radius_mm: 1}\n", 2,
          "obstacles[1].frame");
}

TEST(CellFile, RefusesWhatIsNoYaml) {
  expect_refused([] { load_cell(support::path_of("absent.yaml")); }, 0, "", {"can be read"});
  refused("", 0, "", {"mapping"});
  refused("[1, 2\n", 2, "");
}

}  // namespace cell_files
