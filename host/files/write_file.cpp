#include "files/write_file.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <stdexcept>

namespace flexcomp::host {

namespace {

[[noreturn]] void fail(const std::string& path, int error) {
  throw std::runtime_error(path + ": cannot be written: " + std::strerror(error));
}

void write_to(const std::string& path, std::string_view content, const std::string& name_for_people) {
  struct Close {
    void operator()(std::FILE* f) const { std::fclose(f); }
  };
  const std::unique_ptr<std::FILE, Close> file(std::fopen(path.c_str(), "wb"));
  if (!file) fail(name_for_people, errno);
  if (std::fwrite(content.data(), 1, content.size(), file.get()) != content.size() ||
      std::fflush(file.get()) != 0) {
    fail(name_for_people, errno);
  }
}

}  // namespace

void write_file(const std::string& path, std::string_view content) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::file_status status = fs::status(path, ignored);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    if (fs::is_directory(status)) fail(path, EISDIR);
    write_to(path, content, path);
    return;
  }
  const std::string temporary = path + ".new-" + std::to_string(::getpid());
  try {
    write_to(temporary, content, path);
    std::error_code error;
    fs::rename(temporary, path, error);
    if (error) fail(path, error.value());
  } catch (...) {
    fs::remove(temporary, ignored);
    throw;
  }
}

}  // namespace flexcomp::host
