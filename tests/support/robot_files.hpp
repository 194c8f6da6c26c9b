// SPDX-License-Identifier: Apache-2.0
/// \file
/// The robot files of the project.
#pragma once

#include <string>

#include "files/robot_file.hpp"

namespace support {

const std::string robots = FLEXCOMP_SOURCE_DIR "/host/robots/";
const std::string data = FLEXCOMP_SOURCE_DIR "/tests/data/";

/// Of "tx60l": host/robots/tx60l.yaml.
inline flexcomp::host::Robot robot(const std::string& name) {
  return flexcomp::host::load_robot(robots + name + ".yaml");
}

inline const flexcomp::host::Robot& tx60l() {
  static const flexcomp::host::Robot once = robot("tx60l");
  return once;
}

}  // namespace support
