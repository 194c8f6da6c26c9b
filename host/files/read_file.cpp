// SPDX-License-Identifier: Apache-2.0
#include "files/read_file.hpp"

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

#include "input_error.hpp"

namespace flexcomp::host {

std::string read_file(const std::string& path) {
  struct Close {
    void operator()(std::FILE* f) const { std::fclose(f); }
  };
  const auto unreadable = [&] {
    return InputError(path, 0, "", "a file that can be read", errno == ENOENT ? "none" : std::strerror(errno),
                      errno == ENOENT ? ErrorCode::no_such_file : ErrorCode::none);
  };
  const std::unique_ptr<std::FILE, Close> file(std::fopen(path.c_str(), "rb"));
  if (!file) throw unreadable();
  std::string content;
  std::array<char, 65536> buffer;
  std::size_t got = 0;
  // Opening a directory succeeds; reading it fails.
  while ((got = std::fread(buffer.data(), 1, buffer.size(), file.get())) > 0)
    content.append(buffer.data(), got);
  if (std::ferror(file.get()) != 0) throw unreadable();
  return content;
}

}  // namespace flexcomp::host
