// SPDX-License-Identifier: Apache-2.0
/// \file
/// Files that a command writes, against those that it reads.
#ifndef FLEXCOMP_HOST_COMMANDS_OUTPUTS_HPP
#define FLEXCOMP_HOST_COMMANDS_OUTPUTS_HPP

#include <string>
#include <vector>

namespace flexcomp::host {

/// A file of a run and the option that names it. An empty path is an option that was not given.
struct NamedFile {
  std::string option;
  std::string path;
};

/// Call before the first byte is written. An output that is an input as well would be taken for the input by the next run
/// (a program would be corrected twice); of two outputs in one file the last would win. The same file is told by what it is,
/// whatever it is called: other spellings, symbolic and hard links. Devices and pipes may be named twice.
/// \throws CLI::ValidationError  (usage) naming both options
void refuse_same_file(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs);

}  // namespace flexcomp::host

#endif
