// SPDX-License-Identifier: Apache-2.0
#include "input_error.hpp"

#include <utility>

namespace flexcomp::host {

namespace {

std::string message(const std::string& file, std::size_t line, const std::string& field,
                    const std::string& expected, const std::string& found) {
  std::string m = file;
  if (line != 0) m += ":" + std::to_string(line);
  if (!m.empty()) m += ": ";
  if (!field.empty()) m += field + ": ";
  if (!expected.empty()) m += "expected " + expected;
  if (!found.empty()) m += (expected.empty() ? "" : ", ") + std::string("found ") + found;
  return m;
}

}  // namespace

InputError::InputError(std::string file, std::size_t line, std::string field, std::string expected,
                       std::string found, ErrorCode code)
    : std::runtime_error(message(file, line, field, expected, found)),
      file_(std::move(file)),
      line_(line),
      field_(std::move(field)),
      expected_(std::move(expected)),
      found_(std::move(found)),
      code_(code) {}

}  // namespace flexcomp::host
