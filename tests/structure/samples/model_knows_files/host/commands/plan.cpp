// SPDX-License-Identifier: Apache-2.0
#include "files/robot_file.hpp"
#include "model/robot.hpp"
