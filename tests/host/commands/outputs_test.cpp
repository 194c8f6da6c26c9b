// SPDX-License-Identifier: Apache-2.0
// No output of a run may be one of its inputs or another of its outputs, whatever the file is called.
#include "commands/common_options.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace {

using flexcomp::host::NamedFile;
using flexcomp::host::refuse_same_file;
namespace fs = std::filesystem;

class Outputs : public ::testing::Test {
 protected:
  void SetUp() override {
    before_ = fs::current_path();
    folder_ = fs::temp_directory_path() / ("outputs_test-" + std::to_string(::getpid()));
    fs::create_directories(folder_ / "sub");
    fs::current_path(folder_);
    std::ofstream("in.src") << "PTP\n";
    fs::create_symlink("in.src", "link.src");
    fs::create_hard_link("in.src", "hard.src");
    fs::create_symlink("absent.src", "dangling.src");
    fs::create_symlink(folder_ / "sub", "other_sub");
  }
  void TearDown() override {
    fs::current_path(before_);
    fs::remove_all(folder_);
  }
  static bool refused(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs) {
    try {
      refuse_same_file(inputs, outputs);
    } catch (const CLI::ValidationError& e) {
      message_ = e.what();
      return true;
    }
    return false;
  }

  fs::path before_;
  fs::path folder_;
  static inline std::string message_;
};

TEST_F(Outputs, ThatAreInputsAreRefusedUnderEveryNameOfTheFile) {
  for (const std::string& name :
       {std::string("in.src"), std::string("./in.src"), std::string("sub/../in.src"), std::string("link.src"),
        std::string("hard.src"), (folder_ / "in.src").string()}) {
    EXPECT_TRUE(refused({{"--robot", "r.yaml"}, {"--targets", "in.src"}}, {{"-o", name}})) << name;
    EXPECT_NE(message_.find("-o"), std::string::npos) << message_;
    EXPECT_NE(message_.find("--targets"), std::string::npos) << message_;
    EXPECT_TRUE(refused({{"--targets", name}}, {{"-o", "in.src"}})) << name;
  }
  EXPECT_FALSE(refused({{"--targets", "in.src"}}, {{"-o", "out.src"}, {"--json", "out.json"}}));
  EXPECT_FALSE(refused({{"--targets", "in.src"}}, {{"-o", "sub/in.src"}}));
}

TEST_F(Outputs, ThatAreTheSameAreRefusedAlsoBeforeTheyExist) {
  for (const char* name : {"new.json", "./new.json", "sub/../new.json", "other_sub/../new.json"})
    EXPECT_TRUE(refused({}, {{"-o", "new.json"}, {"--json", name}})) << name;
  EXPECT_TRUE(refused({}, {{"-o", "sub/x"}, {"--report", "r.html"}, {"--json", "other_sub/x"}}));
  EXPECT_NE(message_.find("--json"), std::string::npos) << message_;
  EXPECT_TRUE(refused({}, {{"-o", "dangling.src"}, {"--json", "absent.src"}}));
  EXPECT_FALSE(refused({}, {{"-o", "new.csv"}, {"--json", "new.json"}}));
}

TEST_F(Outputs, OptionsNotGivenAndDevicesMayBeTheSame) {
  EXPECT_FALSE(refused({{"--holdout", ""}}, {{"--json", ""}, {"--report", ""}}));
  EXPECT_FALSE(refused({{"--data", "/dev/null"}}, {{"-o", "/dev/null"}, {"--json", "/dev/null"}}));
}

}  // namespace
