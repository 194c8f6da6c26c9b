/// \file
/// Files appear whole or not at all.
#ifndef FLEXCOMP_HOST_FILES_WRITE_FILE_HPP
#define FLEXCOMP_HOST_FILES_WRITE_FILE_HPP

#include <string>
#include <string_view>

namespace flexcomp::host {

/// Writes beside the target and renames, so that a reader never sees half a file and a failure leaves the old one.
/// What is not a regular file (a pipe, a terminal) is written to directly.
/// \throws std::runtime_error  naming the path and the system's reason
void write_file(const std::string& path, std::string_view content);

}  // namespace flexcomp::host

#endif
