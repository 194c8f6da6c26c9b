// SPDX-License-Identifier: Apache-2.0
// Main of all test programs. `--file NAME` runs the tests of one source, which is what a test of ctest is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <string>

namespace {

/// A filter that lists every test of the source `name`.
std::string tests_of(const std::string& name) {
  std::string filter;
  const testing::UnitTest& all = *testing::UnitTest::GetInstance();
  for (int s = 0; s < all.total_test_suite_count(); ++s) {
    const testing::TestSuite& suite = *all.GetTestSuite(s);
    for (int t = 0; t < suite.total_test_count(); ++t) {
      const testing::TestInfo& test = *suite.GetTestInfo(t);
      const std::string source = test.file();
      if (source.substr(source.find_last_of('/') + 1) == name) {
        filter += std::string(suite.name()) + '.' + test.name() + ':';
      }
    }
  }
  return filter;
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleMock(&argc, argv);
  if (argc == 3 && std::string(argv[1]) == "--file") {
    const std::string filter = tests_of(argv[2]);
    if (filter.empty()) {
      std::fprintf(stderr, "no test is written in %s\n", argv[2]);
      return 1;
    }
    GTEST_FLAG_SET(filter, filter);
  } else if (argc > 1) {
    std::fprintf(stderr, "usage: %s [--file SOURCE] [--gtest_...]\n", argv[0]);
    return 2;
  }
  return RUN_ALL_TESTS();
}
