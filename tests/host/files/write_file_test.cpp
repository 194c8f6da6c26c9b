// SPDX-License-Identifier: Apache-2.0
// A file that is written keeps what it was besides its content: a link stays a link, its mode stays, write protection holds;
// devices are written to and never replaced.
#include "files/write_file.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>

#include "support/text_file.hpp"

namespace {

using flexcomp::host::write_file;
using flexcomp::host::written_path;
using support::path_of;
using support::read;
using testing::HasSubstr;
namespace fs = std::filesystem;

mode_t mode_of(const std::string& path) {
  struct stat s {};
  EXPECT_EQ(::lstat(path.c_str(), &s), 0) << path;
  return s.st_mode;
}

/// What `action` says when it fails; empty where it does not.
std::string failure(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return {};
}

TEST(WriteFile, ALinkStaysAndWhatItPointsAtIsWritten) {
  const std::string target = support::write("target.csv", "old");
  const std::string link = path_of("link.csv");
  fs::create_symlink("target.csv", link);
  const std::string second = path_of("second.csv");
  fs::create_symlink(link, second);
  write_file(second, "new");
  EXPECT_EQ(read(target), "new");
  EXPECT_TRUE(S_ISLNK(mode_of(link)) && S_ISLNK(mode_of(second)) && S_ISREG(mode_of(target)));
  EXPECT_EQ(written_path(second), fs::canonical(target));

  const std::string dangling = path_of("dangling.csv");
  fs::create_symlink("not_there_yet.csv", dangling);
  EXPECT_EQ(written_path(dangling), written_path(path_of("not_there_yet.csv")));
  write_file(dangling, "made");
  EXPECT_TRUE(S_ISLNK(mode_of(dangling)));
  EXPECT_EQ(read(path_of("not_there_yet.csv")), "made");

  const std::string circle = path_of("circle.csv");
  fs::create_symlink("circle.csv", circle);
  EXPECT_THAT(failure([&] { write_file(circle, "x"); }), HasSubstr(circle + ": cannot be written"));
}

TEST(WriteFile, TheModeOfAFileThatIsThereStays) {
  const std::string path = support::write("mode.csv", "old");
  for (const mode_t mode : {0600U, 0664U, 0755U}) {
    ASSERT_EQ(::chmod(path.c_str(), mode), 0);
    write_file(path, "new");
    EXPECT_EQ(mode_of(path) & 07777U, mode);
  }
}

TEST(WriteFile, WriteProtectionHolds) {
  const std::string path = support::write("protected.csv", "old");
  ASSERT_EQ(::chmod(path.c_str(), 0444), 0);
  ASSERT_EQ(::chmod(fs::path(path).parent_path().c_str(), 0777), 0);
  // The superuser may write anything: another user tries, in a process of its own.
  const pid_t child = ::fork();
  if (child == 0) {
    if (::geteuid() == 0 && ::setuid(65534) != 0) ::_exit(3);
    const std::string said = failure([&] { write_file(path, "new"); });
    ::_exit(said.find(path + ": cannot be written") == 0 ? 0 : said.empty() ? 1 : 2);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_EQ(read(path), "old");
  EXPECT_EQ(mode_of(path) & 07777U, 0444U);
}

TEST(WriteFile, NamesTheFileAndLeavesNothingWhereItCannotWrite) {
  const std::string path = path_of("no_folder/x.csv");
  EXPECT_EQ(failure([&] { write_file(path, "x"); }), path + ": cannot be written: No such file or directory");
  const std::string folder = path_of("folder");
  fs::create_directory(folder);
  EXPECT_THAT(failure([&] { write_file(folder, "x"); }), HasSubstr("Is a directory"));
  EXPECT_TRUE(fs::is_empty(folder));
}

TEST(WriteFile, DevicesAndDescriptorsAreWrittenToAndStay) {
  // A pipe behind a link of our own, as /dev/stdout is one: nothing here could harm the machine's /dev.
  const std::string pipe = path_of("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const std::string link = path_of("to_pipe");
  fs::create_symlink("pipe", link);
  const int reader = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK);
  ASSERT_GE(reader, 0);
  write_file(link, "through");
  char text[16] = {};
  EXPECT_EQ(::read(reader, text, sizeof text), 7);
  EXPECT_STREQ(text, "through");
  ::close(reader);
  EXPECT_TRUE(S_ISFIFO(mode_of(pipe)));
  EXPECT_TRUE(S_ISLNK(mode_of(link)));

  // A descriptor that leads to a regular file: written where it stands, also through another link; the file is not replaced.
  const std::string file = support::write("redirected.txt", "");
  std::FILE* const open = std::fopen(file.c_str(), "wb");
  ASSERT_NE(open, nullptr);
  std::fputs("before ", open);
  const std::string fd = "/dev/fd/" + std::to_string(::fileno(open));
  const ino_t inode = [&] {
    struct stat s {};
    ::stat(file.c_str(), &s);
    return s.st_ino;
  }();
  write_file(fd, "one ");
  const std::string own = path_of("to_descriptor");
  fs::create_symlink(fd, own);
  write_file(own, "two ");
  std::fputs("after", open);
  std::fclose(open);
  EXPECT_EQ(read(file), "before one two after");
  struct stat s {};
  ASSERT_EQ(::stat(file.c_str(), &s), 0);
  EXPECT_EQ(s.st_ino, inode);
  EXPECT_TRUE(S_ISLNK(mode_of(own)));
  EXPECT_THAT(failure([] { write_file("/proc/self/fd/987", "x"); }), HasSubstr("Bad file descriptor"));
  EXPECT_EQ(failure([] { write_file("/dev/null", "x"); }), "");
  EXPECT_TRUE(S_ISCHR(mode_of("/dev/null")));
}

}  // namespace
