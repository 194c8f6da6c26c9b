// SPDX-License-Identifier: Apache-2.0
/// \file
/// Writes files atomically.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace flexcomp::host {

/// Resolves the target of a write to `path`: absolute, all symbolic links followed; the file need not exist.
/// \throws std::runtime_error  a cycle of links
std::filesystem::path written_path(const std::string& path);

/// Writes a file atomically: to a temporary file beside the target, which is then renamed; a failure leaves the
/// old file. Symbolic links are followed; an existing file keeps its mode, a write-protected one is refused.
/// Targets that are not regular files (a pipe, a terminal) or lie below /dev or /proc are written directly;
/// /dev/stdout and /dev/fd/N are the descriptors of this process.
/// \throws std::runtime_error  naming the path and the system's reason
void write_file(const std::string& path, std::string_view content);

}  // namespace flexcomp::host
