// SPDX-License-Identifier: Apache-2.0
#include "record_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>

#include "bus/descriptor.hpp"

namespace flexcomp::hil {

namespace {

constexpr std::size_t size = wire::canopen::communication_bytes;

bool write_and_sync(const std::string& path, const std::uint8_t* from) {
  const host::Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  return file && ::write(file.get(), from, size) == static_cast<ssize_t>(size) && ::fsync(file.get()) == 0;
}

}  // namespace

int RecordFile::load(void* self, std::uint8_t* to) {
  const host::Descriptor file(::open(static_cast<RecordFile*>(self)->path_.c_str(), O_RDONLY | O_CLOEXEC));
  std::array<std::uint8_t, size + 1> bytes;
  if (!file || ::read(file.get(), bytes.data(), bytes.size()) != static_cast<ssize_t>(size)) return 0;
  std::copy_n(bytes.begin(), size, to);
  return 1;
}

int RecordFile::save(void* self, const std::uint8_t* from) {
  const std::string& path = static_cast<RecordFile*>(self)->path_;
  const std::string unfinished = path + ".new";
  if (!write_and_sync(unfinished, from) || ::rename(unfinished.c_str(), path.c_str()) != 0) {
    std::fprintf(stderr, "flexcomp-controller: %s cannot be written\n", path.c_str());
    ::unlink(unfinished.c_str());
    return 0;
  }
  // The name, too, has to be on the disk.
  const std::size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const host::Descriptor directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  return directory && ::fsync(directory.get()) == 0 ? 1 : 0;
}

}  // namespace flexcomp::hil
