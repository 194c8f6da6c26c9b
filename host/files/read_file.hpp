// SPDX-License-Identifier: Apache-2.0
/// \file
/// Reads a whole file.
#ifndef FLEXCOMP_HOST_FILES_READ_FILE_HPP
#define FLEXCOMP_HOST_FILES_READ_FILE_HPP

#include <string>

namespace flexcomp::host {

/// Reads a file completely. \throws InputError  no such file, no permission, a directory, a failure while reading
std::string read_file(const std::string& path);

}  // namespace flexcomp::host

#endif
