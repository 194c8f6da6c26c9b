// SPDX-License-Identifier: Apache-2.0
/// \file
/// Files that a test makes, and input that must be refused.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "input_error.hpp"

namespace support {

/// A folder of this process that goes with it.
class Folder {
 public:
  Folder() : path_(std::filesystem::temp_directory_path() / ("flexcomp-test-" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(path_);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  std::string path(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

inline std::string path_of(const std::string& name) {
  static const Folder folder;
  return folder.path(name);
}

inline std::string write(const std::string& name, const std::string& content) {
  std::string path = path_of(name);
  std::ofstream(path, std::ios::binary) << content;
  return path;
}

inline std::string read(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/// `text` with the first `from` replaced; the test fails where it is not there.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

/// Refused with this line and field, in a message that holds all of `parts`.
template <class Action>
void expect_refused(const Action& action, std::size_t line, const std::string& field,
                    const std::vector<std::string>& parts = {}) {
  try {
    action();
    ADD_FAILURE() << "was accepted; expected a refusal of line " << line << ", " << field;
  } catch (const flexcomp::host::InputError& e) {
    EXPECT_EQ(e.line(), line) << e.what();
    EXPECT_EQ(e.field(), field) << e.what();
    for (const std::string& part : parts) EXPECT_THAT(e.what(), testing::HasSubstr(part));
  }
}

}  // namespace support
