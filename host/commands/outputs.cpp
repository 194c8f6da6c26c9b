// SPDX-License-Identifier: Apache-2.0
#include "commands/outputs.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include "files/write_file.hpp"

namespace flexcomp::host {

namespace {

namespace fs = std::filesystem;

bool same_file(const std::string& a, const std::string& b) {
  if (a.empty() || b.empty()) return false;
  std::error_code error;
  const fs::file_status status = fs::status(a, error);
  if (fs::exists(status)) return fs::is_regular_file(status) && fs::equivalent(a, b, error) && !error;
  // What is not there yet is where it will be written.
  try {
    return written_path(a) == written_path(b);
  } catch (const std::runtime_error&) {
    return false;  // cannot be written at all, which is said when it is
  }
}

}  // namespace

void refuse_same_file(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs) {
  for (std::size_t k = 0; k < outputs.size(); ++k) {
    const NamedFile& out = outputs[k];
    for (const NamedFile& in : inputs) {
      if (same_file(out.path, in.path)) {
        throw CLI::ValidationError(
            out.option, fmt::format("{} is read as {}: give another file to write", out.path, in.option));
      }
    }
    for (std::size_t other = 0; other < k; ++other) {
      if (same_file(out.path, outputs[other].path)) {
        throw CLI::ValidationError(out.option, fmt::format("{} is written as {} already: give another file",
                                                           out.path, outputs[other].option));
      }
    }
  }
}

}  // namespace flexcomp::host
