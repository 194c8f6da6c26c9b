// SPDX-License-Identifier: Apache-2.0
/// \file
/// Reads cell files (docs/files.md).
#pragma once

#include <string>

#include "model/cell.hpp"

namespace flexcomp::host {

/// Reads and checks a cell file.
/// \throws InputError  file absent or no YAML; a key that is unknown (with the nearest known one), given twice
///                     or of the wrong kind; an obstacle without ends or radius, or on a frame other than 0;
///                     safety below 0; acceptance_deg not above 0 and at most 180
Cell load_cell(const std::string& path);

}  // namespace flexcomp::host
