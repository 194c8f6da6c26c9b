// SPDX-License-Identifier: Apache-2.0
/// \file
/// Real arms, measured by others (../shared/data, or the folder that FLEXCOMP_DATA names).
#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "measurement/observation.hpp"

namespace flexcomp::host {

struct MeasuredArm {
  Robot robot;
  std::string folder;

  std::vector<Observation> rows(const std::string& file) const {
    return observe(load_data(folder + file, robot), robot);
  }
};

/// Nothing where the data are absent.
inline std::optional<MeasuredArm> measured_arm(const std::string& name) {
  const char* set = std::getenv("FLEXCOMP_DATA");
  const std::string data = set != nullptr ? set : FLEXCOMP_SOURCE_DIR "/../shared/data";
  const std::string folder = data + "/" + name + "/";
  if (!std::filesystem::exists(folder)) return {};
  return MeasuredArm{load_robot(folder + "robot.yaml"), folder};
}

/// A random third held out.
struct Thirds {
  std::vector<Observation> train, test;

  Thirds(std::vector<Observation> rows, unsigned split) {
    std::mt19937 random(split);
    std::shuffle(rows.begin(), rows.end(), random);
    const auto third = static_cast<std::ptrdiff_t>(rows.size() / 3);
    test.assign(rows.begin(), rows.begin() + third);
    train.assign(rows.begin() + third, rows.end());
  }
};

}  // namespace flexcomp::host
