// SPDX-License-Identifier: Apache-2.0
#include "slot_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "input_error.hpp"

namespace flexcomp::hil {

using firmware::StorageResult;

namespace {
constexpr std::uint64_t slot_size = firmware::slot_bytes;
constexpr std::uint64_t file_size = 2 * slot_size;
}  // namespace

SlotFile::SlotFile(const std::string& path)
    : path_(path), file_(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644)) {
  const auto refuse = [&path](const std::string& expected, const std::string& found) {
    throw host::InputError(path, 0, "", expected, found);
  };
  if (!file_) refuse("a file that can be read and written", std::strerror(errno));
  if (::flock(file_.get(), LOCK_EX | LOCK_NB) != 0) {
    refuse("a store that no other controller uses", "a lock on it");
  }
  struct stat info {};
  if (::fstat(file_.get(), &info) != 0) refuse("a file", std::strerror(errno));
  if (!S_ISREG(info.st_mode)) refuse("a regular file", "something else");
  if (info.st_size == 0) {
    if (erase(this, 0) != StorageResult::done || erase(this, 1) != StorageResult::done) {
      refuse("free disk space of " + std::to_string(file_size) + " bytes", std::strerror(errno));
    }
  } else if (static_cast<std::uint64_t>(info.st_size) != file_size) {
    refuse("a store of " + std::to_string(file_size) + " bytes (or no file: it is then made)",
           std::to_string(info.st_size) + " bytes");
  }
}

firmware::Storage SlotFile::hooks() { return {this, read, erase, write}; }

bool SlotFile::put(const std::uint8_t* from, std::uint32_t size, std::uint64_t offset) {
  while (size != 0) {
    const ssize_t n = ::pwrite(file_.get(), from, size, static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    from += n;
    size -= static_cast<std::uint32_t>(n);
    offset += static_cast<std::uint64_t>(n);
  }
  return true;
}

StorageResult SlotFile::read(void* self, unsigned slot, std::uint32_t offset, std::uint8_t* to,
                             std::uint32_t size) {
  const auto& file = *static_cast<SlotFile*>(self);
  std::uint64_t at = slot * slot_size + offset;
  while (size != 0) {
    const ssize_t n = ::pread(file.file_.get(), to, size, static_cast<off_t>(at));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return StorageResult::failed;
    to += n;
    size -= static_cast<std::uint32_t>(n);
    at += static_cast<std::uint64_t>(n);
  }
  return StorageResult::done;
}

StorageResult SlotFile::erase(void* self, unsigned slot) {
  auto& file = *static_cast<SlotFile*>(self);
  std::array<std::uint8_t, slot_size> blank;
  blank.fill(0xFF);
  if (!file.put(blank.data(), blank.size(), slot * slot_size)) return StorageResult::failed;
  return ::fsync(file.file_.get()) == 0 ? StorageResult::done : StorageResult::failed;
}

StorageResult SlotFile::write(void* self, unsigned slot, std::uint32_t offset, const std::uint8_t* from,
                              std::uint32_t size) {
  auto& file = *static_cast<SlotFile*>(self);
  if (!file.put(from, size, slot * slot_size + offset)) return StorageResult::failed;
  return ::fsync(file.file_.get()) == 0 ? StorageResult::done : StorageResult::failed;
}

}  // namespace flexcomp::hil
