// SPDX-License-Identifier: Apache-2.0
/// \file
/// Reads a whole file.
#pragma once

#include <string>

namespace flexcomp::host {

/// Reads a file completely. \throws InputError  no such file, no permission, a directory, a failure while reading
std::string read_file(const std::string& path);

}  // namespace flexcomp::host
