// SPDX-License-Identifier: Apache-2.0
/// \file
/// Reads and writes truth and calibration files (docs/files.md).
#pragma once

#include <string>

#include "model/calibration.hpp"

namespace flexcomp::host {

/// Reads a truth or calibration file. Terms come in the order of the file; one that is not named there does not exist.
/// \throws InputError  file:line: field for: no YAML, a key that is unknown or given twice, an effect that is not in the
///                     catalogue or named twice, a value out of range, base or tool above 20 mm or 2 degrees, another
///                     robot's name or nominal hash
Calibration load_calibration(const std::string& path, const Robot& robot);

/// The text of a calibration file; load_calibration() gives back the identical terms, bit by bit and in order, where
/// geometry, base, tool and effects stand in that order in the set (as load_calibration() and paper_model() make it).
/// \throws std::invalid_argument  a term that the catalogue cannot name
std::string calibration_text(const Calibration& calibration, const Robot& robot);

/// Writes calibration_text() atomically. \throws std::runtime_error where the file cannot be written
void save_calibration(const std::string& path, const Calibration& calibration, const Robot& robot);

}  // namespace flexcomp::host
