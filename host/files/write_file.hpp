// SPDX-License-Identifier: Apache-2.0
/// \file
/// Writes files atomically.
#ifndef FLEXCOMP_HOST_FILES_WRITE_FILE_HPP
#define FLEXCOMP_HOST_FILES_WRITE_FILE_HPP

#include <filesystem>
#include <string>
#include <string_view>

namespace flexcomp::host {

/// The file that a write to `path` reaches: absolute, every symbolic link followed, also where nothing is there yet.
/// \throws std::runtime_error  links that lead round in a circle
std::filesystem::path written_path(const std::string& path);

/// Writes beside the target and renames, so that a reader never sees half a file and a failure leaves the old one. A link
/// stays and what it points at is written; a file that is there keeps its mode, and one that is write-protected is refused.
/// What is not a regular file (a pipe, a terminal) or lies below /dev or /proc is written to directly; /dev/stdout and
/// /dev/fd/N are the descriptors of this process, wherever they lead.
/// \throws std::runtime_error  naming the path and the system's reason
void write_file(const std::string& path, std::string_view content);

}  // namespace flexcomp::host

#endif
