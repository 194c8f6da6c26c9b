// SPDX-License-Identifier: Apache-2.0
// Library code says what is wrong; which option is concerned is added by the error's code alone.
#include "commands/hints.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bus/controller_client.hpp"

namespace flexcomp::host {
namespace {

using testing::HasSubstr;

TEST(Hints, AnErrorWithoutCodeStaysAsItIs) {
  const InputError e("r.yaml", 3, "joints[0].a_mm", "a finite number", "'abc'");
  EXPECT_STREQ(message(e).c_str(), e.what());
  EXPECT_EQ(hint(e, "identify"), "");
}

TEST(Hints, ACodeAddsItsOptions) {
  EXPECT_EQ(
      message(InputError("p.txt", 2, "", "one orientation", "several", ErrorCode::several_orientations)),
      "p.txt:2: expected one orientation, found several (--columns chooses)");
  EXPECT_EQ(
      message(InputError("h.csv", 5, "", "poses that were not fitted", "the same file",
                         ErrorCode::held_out_was_fitted)),
      "h.csv:5: --holdout: expected poses that were not fitted: held-out rows must not be those of --data, "
      "found the same file");
  EXPECT_EQ(message(InputError("", 0, "link9.x", "a parameter", "none", ErrorCode::fixed_parameter)),
            "--fix: link9.x: expected a parameter, found none");
  EXPECT_EQ(message(InputError("a.urdf", 0, "tip", "a link", "'b'", ErrorCode::argument)),
            "a.urdf: --tip: expected a link, found 'b'");
  EXPECT_EQ(message(BusError("can:x:1", "tells no robot", ErrorCode::unknown_robot)),
            "can:x:1: tells no robot: give its file with --robot");
  EXPECT_STREQ(usage_error(ArgumentError(ErrorCode::too_few_poses, "3 poses")).what(), "--poses: 3 poses");
}

TEST(Hints, WhatIsOpenIsSettledByStatusOrResume) {
  const OutcomeOpen e("can:vcan0:5", "the controller was asked to commit the set");
  EXPECT_STREQ(e.what(), "can:vcan0:5: open: the controller was asked to commit the set");
  EXPECT_EQ(hint(e, "rollback"), "\"flexcomp status --of can:vcan0:5\" says which set runs");
  EXPECT_EQ(hint(e, "push"),
            "\"flexcomp status --of can:vcan0:5\" says which set runs; \"flexcomp push --to can:vcan0:5 "
            "--resume\" with the same file settles it");
}

TEST(Hints, ATextThatOnlyLooksLikeAnotherErrorGetsNoHint) {
  EXPECT_EQ(hint(InputError("d.csv", 0, "", "a file that can be read", "none"), "identify"), "");
  EXPECT_EQ(hint(DoubtfulResult("a further step would still gain 1 in chi-square"), "identify"), "");
  EXPECT_THAT(hint(BusError("can:x:1", "no interface is told"), "status"), HasSubstr("status --of can:x:1"));
  EXPECT_THAT(hint(BusError("can:x:1", "there is none", ErrorCode::bus_not_opened), "status"),
              HasSubstr("ip -details link show x"));
  EXPECT_THAT(hint(NoAnswer("modbus-tcp:h:502:1", "silence"), "status"), HasSubstr("--timeout"));
}

}  // namespace
}  // namespace flexcomp::host
