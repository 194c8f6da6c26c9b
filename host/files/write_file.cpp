// SPDX-License-Identifier: Apache-2.0
#include "files/write_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>
#include <system_error>

namespace flexcomp::host {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& path, int error) {
  throw std::runtime_error(path + ": cannot be written: " + std::strerror(error));
}

struct Close {
  void operator()(std::FILE* f) const { std::fclose(f); }
};
using File = std::unique_ptr<std::FILE, Close>;

/// `file` is null where it could not be opened, with the reason in errno.
void write_to(const File& file, std::string_view content, const std::string& name_for_people) {
  if (!file) fail(name_for_people, errno);
  if (std::fwrite(content.data(), 1, content.size(), file.get()) != content.size() ||
      std::fflush(file.get()) != 0) {
    fail(name_for_people, errno);
  }
}

struct Destination {
  fs::path path;
  bool device = false;            ///< below /dev or /proc, or reached through there
  std::optional<int> descriptor;  ///< of this process
};

Destination destination_of(const std::string& path) {
  constexpr int most_links = 40;  // Linux's own limit
  Destination to;
  std::error_code ignored;
  const fs::path descriptors = fs::canonical("/proc/self/fd", ignored);
  to.path = fs::absolute(path);
  for (int link = 0; link <= most_links; ++link) {
    const fs::path folder = fs::weakly_canonical(to.path.parent_path());
    to.path = folder / to.path.filename();
    const std::string name = to.path.filename().string();
    int number = 0;
    const auto read = std::from_chars(name.data(), name.data() + name.size(), number);
    if (!descriptors.empty() && folder == descriptors && read.ec == std::errc() &&
        read.ptr == name.data() + name.size()) {
      to.descriptor = number;
      return to;
    }
    const std::string text = to.path.string();
    to.device = to.device || text.starts_with("/dev/") || text.starts_with("/proc/");
    if (!fs::is_symlink(fs::symlink_status(to.path, ignored))) return to;
    to.path = folder / fs::read_symlink(to.path);
  }
  fail(path, ELOOP);
}

Destination found_destination(const std::string& path) {
  try {
    return destination_of(path);
  } catch (const fs::filesystem_error& e) {
    fail(path, e.code().value());
  }
}

/// Writes a temporary file beside the target and renames it.
void replace(const fs::path& target, std::string_view content, const std::string& path) {
  struct stat old {};
  const bool there = ::stat(target.c_str(), &old) == 0;
  if (there && ::faccessat(AT_FDCWD, target.c_str(), W_OK, AT_EACCESS) != 0) fail(path, errno);
  const fs::path temporary = target.string() + ".new-" + std::to_string(::getpid());
  std::error_code ignored;
  try {
    const File file(std::fopen(temporary.c_str(), "wb"));
    if (file && there) {
      // Keep the owner where permissions allow.
      if (::fchown(::fileno(file.get()), old.st_uid, old.st_gid) != 0) errno = 0;
      if (::fchmod(::fileno(file.get()), old.st_mode & 07777) != 0) fail(path, errno);
    }
    write_to(file, content, path);
    std::error_code error;
    fs::rename(temporary, target, error);
    if (error) fail(path, error.value());
  } catch (...) {
    fs::remove(temporary, ignored);
    throw;
  }
}

}  // namespace

fs::path written_path(const std::string& path) {
  const Destination to = found_destination(path);
  if (!to.descriptor) return to.path;
  std::error_code error;
  const fs::path open = fs::read_symlink(to.path, error);
  return error ? to.path : open;
}

void write_file(const std::string& path, std::string_view content) {
  const Destination to = found_destination(path);
  if (to.descriptor) {
    // Flush earlier output first; the descriptor keeps its offset in a file that it was redirected to.
    std::fflush(nullptr);
    const int copy = ::dup(*to.descriptor);
    if (copy < 0) fail(path, errno);
    write_to(File(::fdopen(copy, "wb")), content, path);
    return;
  }
  std::error_code ignored;
  const fs::file_status status = fs::status(to.path, ignored);
  if (fs::is_directory(status)) fail(path, EISDIR);
  if (to.device || (fs::exists(status) && !fs::is_regular_file(status))) {
    write_to(File(std::fopen(to.path.c_str(), "wb")), content, path);
    return;
  }
  replace(to.path, content, path);
}

}  // namespace flexcomp::host
